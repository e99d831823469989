"""Outlines of labels, against constructed fonts, fontTools and closed forms, and icons from SVG."""

from __future__ import annotations

import contextlib
import math
import random
from itertools import combinations, pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from fontTools.pens.areaPen import AreaPen
from fontTools.ttLib import TTFont

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.icons import icon_section
from dicedesign.fabricate.label_art import (
    MOST_PIPS,
    label_arts,
    line_breaks,
    pip_places,
    pips_section,
    text_section,
    upside_down,
)

BUNDLED = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans-Bold.ttf")


def test_numbers_that_read_as_another_label_upside_down_are_marked() -> None:
    """Of 0 to 99 as on two dice, those whose turned digits are another number with as many."""
    turned = str.maketrans("01689", "01986")
    labels = [str(number) for number in range(100)]
    for text in labels:
        other = text[::-1].translate(turned)
        is_marked = set(text) <= set("01689") and other != text and other[0] != "0"
        art, *_ = label_arts(text, EngravingOptions(), labels)
        assert art.section.area() > text_section(text).area() + 0.01 or not is_marked
        (alone,) = label_arts(text, EngravingOptions(), [text])
        assert alone.section.area() == pytest.approx(text_section(text).area())
        assert is_marked == (upside_down(text) in labels and upside_down(text) != text)


def test_a_bar_is_beneath_an_ambiguous_label_and_a_dot_after_it() -> None:
    plain = text_section("16")
    barred, dotted = (
        label_arts("16", EngravingOptions(ambiguous=mark), ["91"])[0].section
        for mark in ("bar", "dot")
    )
    left, bottom, right, _ = plain.bounds()
    x0, y0, x1, y1 = min((part.bounds() for part in barred.decompose()), key=lambda box: box[1])
    assert y1 < bottom
    assert (x0, x1) == pytest.approx((left, right), abs=1e-6)
    assert barred.area() == pytest.approx(plain.area() + (x1 - x0) * (y1 - y0))
    x0, y0, x1, y1 = max((part.bounds() for part in dotted.decompose()), key=lambda box: box[0])
    assert x0 > right
    assert y0 == pytest.approx(0.0, abs=1e-6)
    circle = math.pi * (x1 - x0) * (y1 - y0) / 4.0
    assert dotted.area() == pytest.approx(plain.area() + circle, rel=2e-3)


def test_pips_are_separate_circles_symmetric_under_a_half_turn() -> None:
    for number in range(1, MOST_PIPS + 1):
        section = pips_section(str(number))
        places, diameter = pip_places(number)
        assert len(section.decompose()) == number
        assert section.area() == pytest.approx(number * math.pi * diameter**2 / 4.0, rel=0.02)
        assert -1e-6 < min(section.bounds()) < max(section.bounds()) < 1.0 + 1e-6
        gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(number, 1)]
        assert (gaps > 1.2 * diameter).all()
        turned = np.linalg.norm(places[:, None] - (1.0 - places), axis=-1)
        assert turned.min(axis=1).max() < 1e-12
    for text in ("0", "21", "-1", "²"):
        with pytest.raises(EngravingError, match="1 to 20"):
            pips_section(text)


def test_areas_equal_those_of_fonttools() -> None:
    font = TTFont(BUNDLED)
    glyphs, names, unit = font.getGlyphSet(), font.getBestCmap(), font["glyf"]["one"].yMax
    for text in ("8", "16", "3/6", "A & B", "½", "ÄÖ"):
        expected = 0.0
        for character in text.replace(" ", ""):
            pen = AreaPen(glyphs)
            glyphs[names[ord(character)]].draw(pen)
            expected += abs(pen.value) / unit**2
        assert text_section(text).area() == pytest.approx(expected, rel=3e-3)


def test_lines_are_broken_at_spaces_where_the_widest_is_narrowest() -> None:
    """Compared with all line breaks, by the bounds of the sections."""
    words = ["a", "critical", "hit", "or", "a", "miss"]
    broken = [text for text in line_breaks(" ".join(words)) if "-" not in text]
    assert [text.count("\n") for text in broken] == [0, 1, 2, 3]
    assert all(text.replace("\n", " ").split(" ") == words for text in broken)
    for count, text in enumerate(broken):
        widths = []
        for breaks in combinations(range(1, len(words)), count):
            ends = [0, *breaks, len(words)]
            lines = [" ".join(words[i:j]) for i, j in pairwise(ends)]
            widths.append(max(text_section(line).bounds()[2] for line in lines))
        widest = max(text_section(line).bounds()[2] for line in text.split("\n"))
        assert widest == pytest.approx(min(widths), abs=0.1)


def test_words_are_hyphenated_between_syllables() -> None:
    """As dictionaries do; words without such a place stay whole."""
    for parted in (
        "Sep-tem-ber",
        "Thursday",
        "Wed-nes-day",
        "Janu-ary",
        "mother",
        "kit-ten",
        "3d6",
    ):
        *_, last = line_breaks(parted.replace("-", ""))
        assert last == parted.replace("-", "-\n")
    assert list(line_breaks("crit\u00adical")) == ["critical", "crit-\nical"]


def test_fonts_say_how_letters_follow_each_other() -> None:
    """The first letter of Hebrew, alef, is the rightmost; "AV" is closer than "AH"."""
    alef, both = text_section("א"), text_section("אב")
    rightmost = max(both.decompose(), key=lambda part: part.bounds()[2])
    assert rightmost.area() == pytest.approx(alef.area(), rel=1e-6)
    gaps = []
    for pair in ("AV", "AH"):
        first, second = sorted(part.bounds()[::2] for part in text_section(pair).decompose())
        gaps.append(second[0] - first[1])
    assert gaps[0] < 0.0 < gaps[1]
    by_name, bundled = text_section("8", "DejaVu Sans"), text_section("8")
    assert by_name.area() == pytest.approx(bundled.area())
    assert text_section("8", "dejavu serif").area() != pytest.approx(bundled.area(), rel=1e-2)


def test_what_a_font_cannot_draw_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.otf"
    for text, font, expected in (
        ("1骰", "", "9AB0"),
        (" ", "", "visible"),
        ("1", "DejaVu Sanz", "engrave.font.*'DejaVu Sanz'"),
    ):
        with pytest.raises(InputError, match=expected):
            text_section(text, *filter(None, [font]))
    for content in (b"", b"\x00\x01\x00\x00" + bytes(500), b"OTTO\xff\xff" * 99):
        path.write_bytes(content)
        with pytest.raises(InputError, match="font"):
            text_section("1", str(path))


def test_damaged_fonts_give_a_label_or_an_input_error(tmp_path: Path) -> None:
    """Bytes overwritten anywhere or in the list of tables, and files cut short."""
    data, chance = BUNDLED.read_bytes(), random.Random(0)
    path = tmp_path / "damaged.ttf"
    for _ in range(40):
        damaged = bytearray(data)
        for _ in range(chance.choice((1, 5, 100))):
            place = chance.randrange(chance.choice((300, len(data))))
            damaged[place] = chance.randrange(256)
        if chance.random() < 0.2:
            damaged = damaged[: chance.randrange(len(data))]
        path.write_bytes(damaged)
        with contextlib.suppress(InputError, EngravingError):
            assert text_section("128", str(path)).area() > 0.0


# Icons.


def write_icon(folder: Path, content: str, before: str = "", root: str = "") -> str:
    path = folder / "icon.svg"
    space = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    path.write_text(f'{before}<svg {space} viewBox="0 0 100 100" {root}>{content}</svg>')
    return str(path)


# Content, width over height, and area over the square of the height.
SHAPES = [
    ('<circle cx="50" cy="40" r="20"/>', 1.0, math.pi / 4),
    ('<rect x="-3" y="4" width="40" height="20"/>', 2.0, 2.0),
    ('<rect width="40" height="20" rx="5"/>', 2.0, 2.0 - (4 - math.pi) / 16),
    ('<rect width="10" height="20" style="fill: #222; stroke:none"/>', 0.5, 0.5),
    ('<polygon points="0,0 10,0 0,20"/>', 0.5, 0.25),
    ('<path d="M0 0 A10 10 0 0 1 20 0 z"/>', 2.0, math.pi / 2),
    ('<path d="M0 0 C0 4 10 4 10 0 z"/>', 10 / 3, 0.6 * 40 / 9),
    ('<path d="M0 0 Q10 20 20 0 z"/>', 2.0, 4 / 3),
    ('<path d="m0 0 10 0 0 10-10 0zm2 2 0 6 6 0 0-6z"/>', 1.0, 0.64),
    ('<path fill-rule="evenodd" d="M0 0h9v9h-9z M1 1h7v7h-7z M2 2h5v5h-5z"/>', 1.0, 57 / 81),
    ('<rect width="10" height="10"/><rect x="2" y="2" width="6" height="6" fill="#fff"/>', 1, 0.64),
    ('<rect width="10" height="10"/><g opacity="0"><circle r="50"/></g>', 1.0, 1.0),
    (
        '<g fill="none"><circle r="9"/><rect fill="currentColor" width="1" height="2"/></g>',
        0.5,
        0.5,
    ),
    ('<g transform="scale(2 1)"><circle transform="translate(5,5)" r="3"/></g>', 2.0, math.pi / 2),
    ('<rect transform="matrix(0 1 -2 0 7 7)" width="10" height="10"/>', 2.0, 2.0),
    ('<rect transform=" translate( 5 ) , skewY(45)" width="10" height="10"/>', 0.5, 0.25),
    ('<title>a</title><desc>b</desc><defs><circle r="99"/></defs><circle r="5"/>', 1, math.pi / 4),
    ('<circle r="4" fill="none" stroke="black" stroke-width="2"/>', 1.0, math.pi / 4 * 0.64),
    (
        '<path d="M0 0h20" stroke="#111" stroke-width="10" stroke-linecap="round"/>',
        3.0,
        2 + math.pi / 4,
    ),
    (
        '<defs><rect id="a" width="5" height="5"/></defs><use href="#a"/><use x="5" href="#a"/>',
        2.0,
        2.0,
    ),
    # The last transform applies first.
    (
        '<rect width="1" height="9"/>'
        f'<rect transform="{"translate(1 0)" * 99} scale(2 1)" width="1" height="1"/>',
        101 / 9,
        11 / 81,
    ),
    ('<x:view xmlns:x="urn:editor" width="3"/><circle r="5"/><!-- note -->', 1.0, math.pi / 4),
]


def test_areas_of_shapes_and_strokes(tmp_path: Path) -> None:
    for content, aspect, area in SHAPES:
        section = icon_section(write_icon(tmp_path, content), "x")
        assert section.bounds() == pytest.approx((0.0, 0.0, aspect, 1.0), abs=2e-3), content
        assert section.area() == pytest.approx(area, rel=4e-3), content


def test_icons_are_upright(tmp_path: Path) -> None:
    """y runs downward in SVG: an L of a stem and a foot on its right has the foot below."""
    section = icon_section(write_icon(tmp_path, '<path d="M0 0h2v8h6v2h-8z"/>'), "L")
    parts = section.to_polygons()
    corner = max((point for part in parts for point in part), key=lambda p: p[0] - p[1])
    assert tuple(corner) == pytest.approx((0.8, 0.0), abs=1e-6)
    assert section.area() == pytest.approx(0.32)


def test_an_icon_replaces_its_label_only(tmp_path: Path) -> None:
    path = write_icon(tmp_path, '<rect width="5" height="5"/>')
    options = EngravingOptions(icons={"6": path})
    assert label_arts("6", options, [])[0].section.area() == pytest.approx(1.0)
    (other,), (plain,) = (label_arts("9", each, ["6"]) for each in (options, EngravingOptions()))
    assert other.section.area() == plain.section.area()


DARK = ["#1a1A1a", "rgb(12.5%, 0%, 3%)", "currentColor", "RebeccaPurple", "rgb(0 0 99 / .5)"]
LIGHT = ["white", "#EEE", "rgb(99.9%,90%,80%)", "LightGray", "rgba(255,255,255,1)"]


def test_dark_colors_are_cut_and_light_ones_are_not(tmp_path: Path) -> None:
    for color in [*DARK, *LIGHT]:
        content = f'<rect width="10" height="10"/><rect width="5" height="5" fill="{color}"/>'
        area = 1.0 if color in DARK else 0.75
        assert icon_section(write_icon(tmp_path, content), "x").area() == pytest.approx(area)


LAUGH = '<use href="#l{}"/>'
LAUGHS = "".join(f'<g id="l{n}">{2 * LAUGH.format(n - 1)}</g>' for n in range(1, 25))

BAD = [
    ("<defs><script href='x.js'/></defs><circle r='5'/>", "scripts"),
    ("<style>.a{fill:none}</style><circle r='5'/>", "style"),
    ("<image href='http://example.org/a.png'/>", "<image>"),
    ("<text>6</text>", "<text>"),
    ("<use xlink:href='#a'/>", "<use>"),
    ("<g id='a'><use xlink:href='#a'/></g>", "within each other"),
    (f"{LAUGHS}<g id='l0'><circle r='5'/></g>", "1000 shapes"),
    ("<circle r='5' clip-path='url(#a)'/>", "clip-path"),
    ("<circle r='5' fill='none'/>", "none"),
    ("<path d='M0 0 L5 5'/>", "area"),
    ("<circle r='1e9'/>", "coordinates"),
    ("<circle r='5' transform='scale(inf)'/>", "coordinates"),
    ("<circle r='5' transform='spin(3)'/>", r"spin\(3\)"),
    # A search for calls in this one would take minutes to hours.
    (f"<circle transform='rotate(0){' ' * 10**6}x'/>", "2000 characters as transform"),
    (f"<circle r='5' transform='{40 * 'scale(1) '}!'/>", "can be read"),
    (f"<path d='M0 0{30_000 * 'L1 1L2 0'}z'/>", "at most 80000 elements, commands and numbers"),
    (f"<circle r='5' {' '.join(f'a{n}=' + 2 * chr(34) for n in range(200))}/>", "100 attributes"),
    (f"{LAUGHS}<g id='l0'/><circle r='5'/>", "at most 80000 elements"),
    (f"<path d='M0 0A{'0' * 9000} 1 0 0 0 1 1'/>", "2000 characters as d"),
    ("<circle r='5' fill='url(#g)'/>", r"'url\(#g\)'"),
    ("<circle r='5' opacity='some'/>", "'some'"),
    (f"<path d='M0 0L{'1 2 3 1 ' * 8000}z'/>", "10000 corners"),
    ("<g>" * 150 + "<circle r='5'/>" + "</g>" * 150, "within each other"),
]


def test_unsupported_content_is_refused_by_name(tmp_path: Path) -> None:
    for content, message in BAD:
        with pytest.raises(InputError, match=f"engrave.icons: label 'x': .*{message}"):
            icon_section(write_icon(tmp_path, content), "x")


def test_entities_are_neither_replaced_nor_looked_up(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("M0 0h9v9z")
    laughs = "".join(f'<!ENTITY l{n} "&l{n - 1};&l{n - 1};&l{n - 1};">' for n in range(1, 20))
    for entity in (
        f'<!ENTITY a SYSTEM "file://{tmp_path}/secret">',
        f'<!ENTITY l0 "ha">{laughs}<!ENTITY a "&l19;">',
    ):
        content = '<desc>&a;</desc><circle r="5"/>'
        path = write_icon(tmp_path, content, before=f"<!DOCTYPE svg [{entity}]>")
        with pytest.raises(InputError, match=r"no entities|no XML"):
            icon_section(path, "x")


def test_a_file_that_is_no_svg_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "icon.svg"
    with pytest.raises(InputError, match="no such file"):
        icon_section(str(path), "x")
    for content, message in (
        (b"\x89PNG\r\n\x1a\n" + bytes(99), "no XML"),
        (b"<html/>", "an element <html>"),
        (bytes(2 << 20), "at most 1 MiB"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            icon_section(str(path), "x")


PICTURE = (
    '<g transform="translate(0 2) rotate(9 3 3)"><path d="M32 2C17 2 8 12 8 26q3 4 9 17v9a5 5 0 0 1'
    ' 5 5h20zm3 9l4 4-9 2z" fill-rule="evenodd"/><circle cx="22" cy="27" r="6" fill="#fff"/>'
    '<rect x="1" y="2" width="9" height="9" rx="2" style="fill:black"/></g>'
)

PIECES = [b"1e308", b"-", b"nan", b"a0 0 0 0 0 0 0", b"z", b"M", b"<g>", b"99999999", b"\xff"]
PIECES += [
    b'transform="scale(0)"',
    b'transform="matrix(1e5 0 0 1e5 0 0)"',
    b"1e-320",
    b"Q",
    b"&#0;",
]


def test_damaged_files_give_an_icon_or_an_input_error(tmp_path: Path) -> None:
    path, chance = Path(write_icon(tmp_path, PICTURE)), random.Random(0)
    data, icons = path.read_bytes(), 0
    for _ in range(150):
        damaged = bytearray(data)
        for _ in range(chance.randrange(1, 4)):
            place = chance.randrange(100, len(damaged))
            kind = chance.randrange(3)
            if kind == 0:
                damaged[place] = chance.randrange(32, 128)
            elif kind == 1:
                del damaged[place : place + chance.randrange(1, 9)]
            else:
                damaged[place:place] = chance.choice(PIECES)
        path.write_bytes(damaged)
        with contextlib.suppress(InputError):
            assert icon_section(str(path), "x").area() > 0.0
            icons += 1
    assert 8 < icons < 142
