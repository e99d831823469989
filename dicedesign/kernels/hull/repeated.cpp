#include "hull/repeated.hpp"

#include <cstring>

namespace dicedesign {
namespace {

// A set of positions, each known by the number that it was entered with.
class PositionTable {
public:
    PositionTable(const Vec* points, std::size_t count) : points_(points) {
        std::size_t size = 8;
        while (size < 2 * count) size *= 2;
        mask_ = size - 1;
        slots_.assign(size, -1);
    }

    // The number at the position of a point; a new one is entered with its own.
    Index find(Index point) {
        const Vec& p = points_[point];
        std::size_t slot = hash(p) & mask_;
        while (slots_[slot] >= 0) {
            const Vec& q = points_[slots_[slot]];
            if (p.x == q.x && p.y == q.y && p.z == q.z) return slots_[slot];
            slot = (slot + 1) & mask_;
        }
        return slots_[slot] = point;
    }

private:
    static std::uint64_t bits(double x) {
        x += 0.0;  // turns -0 into 0
        std::uint64_t found;
        std::memcpy(&found, &x, sizeof found);
        return found;
    }

    // Short numbers end in many zeros: turned by a third of the digits each, coordinates do not
    // hide each other. The rest are the finishing steps of splitmix64.
    static std::size_t hash(const Vec& p) {
        const auto turned = [](std::uint64_t x, int by) { return x << by | x >> (64 - by); };
        std::uint64_t x = bits(p.x) + turned(bits(p.y), 21) + turned(bits(p.z), 42);
        x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
        x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
        return static_cast<std::size_t>(x ^ (x >> 31));
    }

    const Vec* points_;
    std::size_t mask_;
    std::vector<Index> slots_;
};

}  // namespace

Positions distinct_positions(const Vec* points, std::size_t count) {
    PositionTable table(points, count);
    Positions found;
    found.group.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Index number = static_cast<Index>(i), first = table.find(number);
        if (first == number) {
            found.group[i] = static_cast<Index>(found.first.size());
            found.first.push_back(number);
        } else {
            found.group[i] = found.group[first];
        }
    }
    return found;
}

}  // namespace dicedesign
