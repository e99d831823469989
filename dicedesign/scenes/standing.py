"""Mesh files stood in poses."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.meshes.formats import without_solids
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.workers import as_ended, is_lost_worker
from dicedesign.scenes.posed_file import Y_UP, posed_bytes

__all__ = ["Job", "PoseChoice", "Stood", "stand", "stand_all", "stand_many"]

FILES_PER_TASK: Final = 16
"""At most: handing over a task costs far less than they do."""

TASKS_PER_WORKER: Final = 4
"""At least, if the files suffice, so that all workers end at about the same time."""


@dataclass(frozen=True)
class PoseChoice:
    """Which pose of a body, and how its rests are found.

    Attributes
    ----------
    number: of the rest, the most probable being 1.
    seed: to draw a rest by its odds instead, and a heading; None draws nothing.
    center_of_mass, coplanar_tolerance: as in `rest_poses`.
    y_up: whether bodies stand on y = 0 instead of z = 0.
    """

    number: int = 1
    seed: int | None = None
    center_of_mass: tuple[float, float, float] | Literal["hull"] | None = None
    coplanar_tolerance: float | None = None
    y_up: bool = False

    def of(self, poses: RestPoses, name: str) -> tuple[int, Floats]:
        """A rest, counted from 0, and its transform (4, 4).

        name: of the body. One seed draws for each name on its own, so that it does not matter
        which other bodies there are. Raises InputError: there is no rest of that number.
        """
        rests = len(poses.probabilities)
        if self.seed is not None:
            own = [self.seed, zlib.crc32(name.encode("utf-8", "surrogateescape"))]
            transforms, drawn = poses.sample(1, np.random.default_rng(own))
            rest, transform = int(drawn[0]), transforms[0]
        elif self.number <= rests:
            rest, transform = self.number - 1, poses.transforms[self.number - 1]
        else:
            raise InputError(
                f"{name}: expected a body of at least {self.number} poses, got one of {rests}; "
                f"choose a --pose from 1 to {rests}"
            )
        return rest, Y_UP @ transform if self.y_up else transform


@dataclass(frozen=True)
class Job:
    """A file to be read, its name among the others, and the file to be written."""

    source: Path
    name: str
    target: Path


@dataclass(frozen=True)
class Stood:
    """What became of a job.

    Attributes
    ----------
    job: what was to be done.
    rest: in which it stands, counted from 0; rests: how many there are.
    probability: of that rest.
    transform: (4, 4) from the mesh to the file, as lists.
    notes: about the body, one sentence each.
    error: why nothing was written, in one line, or empty.
    """

    job: Job
    rest: int = -1
    rests: int = 0
    probability: float = 0.0
    transform: tuple[tuple[float, ...], ...] = ()
    notes: tuple[str, ...] = ()
    error: str = ""


def stand(job: Job, choice: PoseChoice) -> Stood:
    """Write a mesh file's body in a pose. Raises as `read_body`, `rest_poses`, `PoseChoice.of`,
    `posed_bytes` and `atomic_write`."""
    with without_solids():
        body = read_body(job.source)
        poses = rest_poses(
            body, choice.center_of_mass, coplanar_tolerance=choice.coplanar_tolerance
        )
        rest, transform = choice.of(poses, job.name)
        data = posed_bytes(job.source, body, transform, job.target.suffix)
    atomic_write(job.target, data)
    return Stood(
        job,
        rest,
        len(poses.probabilities),
        float(poses.probabilities[rest]),
        tuple(map(tuple, transform.tolist())),
        poses.notes,
    )


def stand_all(jobs: Sequence[Job], choice: PoseChoice) -> list[Stood]:
    """A worker's task: each file on its own; one that cannot be done says why."""
    stood = []
    for job in jobs:
        try:
            stood.append(stand(job, choice))
        except Exception as error:
            # Thousands of files are not given up for one, even where the fault is ours.
            said = str(error) if isinstance(error, DiceError) else f"{job.source}: {error!r}"
            stood.append(Stood(job, error=" ".join(said.split())))
    return stood


def stand_many(
    jobs: Sequence[Job],
    choice: PoseChoice,
    executor: Executor,
    workers: int,
    *,
    on_done: Callable[[int], None],
    on_quiet: Callable[[], None] | None = None,
) -> list[Stood]:
    """What became of many jobs, in their order. Those whose worker was lost run again alone, so
    that none is blamed for another.

    Parameters
    ----------
    jobs: with different targets.
    executor: runs them, so many `workers` at a time.
    on_done: told how many ended; on_quiet: called whenever none has for some seconds.

    Raises DiceError: the executor cannot go on.
    """
    done: dict[Path, Stood] = {}
    size = max(1, min(FILES_PER_TASK, len(jobs) // (TASKS_PER_WORKER * workers)))
    for most, tasks_at_once in ((size, 2 * workers), (1, 1)):
        left = [job for job in jobs if job.target not in done]
        tasks = iter([left[k : k + most] for k in range(0, len(left), most)])
        ended = as_ended(
            partial(next, tasks, None),
            lambda task: executor.submit(stand_all, task, choice),
            tasks_at_once,
            on_quiet,
        )
        for task, future in ended:
            try:
                stood = future.result()
            except Exception as error:
                if not is_lost_worker(error):
                    raise
            else:
                done |= {one.job.target: one for one in stood}
                on_done(len(task))
    return [done.get(job.target, _lost(job)) for job in jobs]


def _lost(job: Job) -> Stood:
    return Stood(
        job,
        error=f"{job.source}: expected workers that stay, but those that posed it were lost; see "
        "whether memory suffices",
    )
