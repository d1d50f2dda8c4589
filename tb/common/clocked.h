// What the benches in C++ that clock a module share: words that mean nothing, and an edge of its clock.
#pragma once

#include <cstdint>

// Marsaglia's xorshift with a fixed seed: the same words in every run.
inline std::uint32_t random_word() {
    static std::uint64_t state = 88172645463325252ull;
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return static_cast<std::uint32_t>(state >> 16);
}

// One whole period of clk_i; outputs afterwards are those that follow the rising edge.
template <class Top>
void edge(Top& top) {
    top.clk_i = 1;
    top.eval();
    top.clk_i = 0;
    top.eval();
}
