// The separatrices of Python as kernels take them.
#pragma once

#include "arrays.hpp"
#include "rest/areas.hpp"

namespace dicedesign {

// Borrows the arrays of a `Separatrices`, except the saddles.
class PathsHandle {
public:
    PathsHandle(Indices rests, IndexPairs basins, IndexPairs saddle_ends, IndexPairs crossings,
                Indices branch_start, Indices maxima)
        : indices_{rests, branch_start, maxima},
          pairs_{basins, saddle_ends, crossings},
          paths_{static_cast<Index>(rests.shape(0)),
                 static_cast<Index>(basins.shape(0)),
                 rests.data(),
                 basins.data(),
                 saddle_ends.data(),
                 crossings.data(),
                 branch_start.data(),
                 maxima.data()} {}

    // Of arrays that were made here; `owners` keep them.
    PathsHandle(const Paths& paths, std::vector<nb::object>&& owners)
        : owners_(std::move(owners)), paths_(paths) {}

    const Paths& operator*() const { return paths_; }
    const Paths* operator->() const { return &paths_; }

private:
    // What the paths point into.
    std::vector<Indices> indices_;
    std::vector<IndexPairs> pairs_;
    std::vector<nb::object> owners_;
    Paths paths_;
};

}  // namespace dicedesign
