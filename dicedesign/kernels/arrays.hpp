// NumPy arrays in and out of the kernels.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <utility>
#include <vector>

#include "vector.hpp"

namespace dicedesign {

namespace nb = nanobind;

using Floats = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const Index, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using IndexPairs = nb::ndarray<const Index, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

static_assert(sizeof(Vec) == 3 * sizeof(double));

// The rows of an (n, 3) array.
inline const Vec* rows(const Points& points) {
    return reinterpret_cast<const Vec*>(points.data());
}

// The one of an array (3,).
inline Vec vector(const Floats& numbers) { return {numbers(0), numbers(1), numbers(2)}; }

// Room for vectors in an (n, 3) array.
inline Vec* vectors(std::vector<double>& numbers) {
    return reinterpret_cast<Vec*>(numbers.data());
}

// A NumPy array of a shape that owns the numbers of a vector.
template <class Number, class T>
nb::object owning(std::vector<T>&& values, std::size_t dimensions, const std::size_t* shape) {
    auto* kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    auto* first = reinterpret_cast<Number*>(kept->data());
    return nb::cast(nb::ndarray<nb::numpy, Number>(first, dimensions, shape, owner));
}

// A NumPy array of the numbers of a vector, with `columns` of them in each row; one row is one
// number for columns 0.
template <class T>
inline nb::object array(std::vector<T>&& values, std::size_t columns = 0) {
    const std::size_t count = values.size();
    const std::size_t shape[2] = {columns == 0 ? count : count / columns, columns};
    return owning<T>(std::move(values), columns == 0 ? 1 : 2, shape);
}

// A NumPy array (n, 3).
inline nb::object array(std::vector<Vec>&& vectors) {
    const std::size_t shape[2] = {vectors.size(), 3};
    return owning<double>(std::move(vectors), 2, shape);
}

// A NumPy array (3,).
inline nb::object array(const Vec& a) { return array(std::vector<double>{a.x, a.y, a.z}); }

}  // namespace dicedesign
