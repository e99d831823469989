#include "hull/spatial_order.hpp"

#include <numeric>

namespace dicedesign {
namespace {

// Ten bits with two zeros between each.
std::uint32_t spread(std::uint32_t x) {
    x = (x | (x << 16)) & 0x030000ff;
    x = (x | (x << 8)) & 0x0300f00f;
    x = (x | (x << 4)) & 0x030c30c3;
    return (x | (x << 2)) & 0x09249249;
}

std::uint32_t cell(double x) { return static_cast<std::uint32_t>((x + 1.0) * 511.5); }

}  // namespace

std::vector<int> spatial_order(const std::vector<Vec>& points) {
    // Morton codes, sorted by ten of their bits at a time.
    struct Entry {
        std::uint32_t code;
        int number;
    };
    constexpr int BITS = 10;
    constexpr std::uint32_t MASK = (1u << BITS) - 1;
    std::vector<Entry> entries(points.size()), sorted(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec& p = points[i];
        entries[i] = {spread(cell(p.x)) | spread(cell(p.y)) << 1 | spread(cell(p.z)) << 2,
                      static_cast<int>(i)};
    }
    for (int shift = 0; shift < 3 * BITS; shift += BITS) {
        std::vector<std::size_t> place(MASK + 2, 0);
        for (const Entry& entry : entries) ++place[(entry.code >> shift & MASK) + 1];
        std::partial_sum(place.begin(), place.end(), place.begin());
        for (const Entry& entry : entries) sorted[place[entry.code >> shift & MASK]++] = entry;
        entries.swap(sorted);
    }
    std::vector<int> order(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) order[i] = entries[i].number;
    return order;
}

}  // namespace dicedesign
