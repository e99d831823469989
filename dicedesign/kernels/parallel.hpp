// Loops whose turns do not know each other, on several threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <system_error>
#include <thread>
#include <vector>

namespace dicedesign {

// Calls `work(i)` for i from 0 to `count`, on at most `threads` threads. A thread takes a few calls
// at a time, and starts only if there are that many. Rethrows an exception after all have ended.
template <class Work>
void in_parallel(std::size_t count, std::size_t threads, const Work& work) {
    constexpr std::size_t TURNS = 8;
    std::atomic<std::size_t> next{0};
    std::vector<std::exception_ptr> errors(
        std::max<std::size_t>(1, std::min(threads, (count + TURNS - 1) / TURNS)));
    const auto share = [&](std::exception_ptr& error) {
        try {
            for (;;) {
                const std::size_t first = next.fetch_add(TURNS);
                if (first >= count) return;
                for (std::size_t i = first; i < std::min(count, first + TURNS); ++i) work(i);
            }
        } catch (...) {
            error = std::current_exception();
        }
    };
    std::vector<std::thread> others;
    for (std::size_t t = 1; t < errors.size(); ++t) {
        try {
            others.emplace_back(share, std::ref(errors[t]));
        } catch (const std::system_error&) {
            break;  // no more threads available
        }
    }
    share(errors[0]);
    for (std::thread& other : others) other.join();
    for (const std::exception_ptr& error : errors)
        if (error) std::rethrow_exception(error);
}

}  // namespace dicedesign
