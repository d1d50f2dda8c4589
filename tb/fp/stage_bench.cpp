// Gives stage_bench a pair of operands a clock, with enables of its three stages, and writes sum and product after each.
//
//   Vstage_bench <pairs.bin> <out.bin> <enables>
//
// pairs: uint32 a, b; out: for each pair uint32 sum, product as they stand after its clock.
// enables: "all" = always on; "random" = each stage's by itself, one in two. The first clocks are always on: what the
// registers start with is no result.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

#include "Vstage_bench.h"
#include "../common/coverage.h"
#include "verilated.h"

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    const bool random = std::strcmp(argv[3], "random") == 0;
    std::vector<std::uint32_t> pairs, out;
    std::FILE* const in = std::fopen(argv[1], "rb");
    if (!in) return 2;
    for (std::uint32_t pair[2]; std::fread(pair, sizeof pair, 1, in) == 1;) pairs.insert(pairs.end(), pair, pair + 2);
    std::fclose(in);
    std::uint64_t state = 88172645463325252ull;
    Vstage_bench top;
    top.clk_i = 0;
    top.eval();
    for (std::size_t k = 0; k < pairs.size(); k += 2) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        top.en_i = random && k >= 12 ? static_cast<CData>(state >> 32 & 7) : 7;
        top.sub_i = static_cast<CData>(state >> 40 & 1);
        top.a_i = pairs[k];
        top.b_i = pairs[k + 1];
        top.clk_i = 1;
        top.eval();
        top.clk_i = 0;
        top.eval();
        out.push_back(top.sum_o);
        out.push_back(top.product_o);
    }
    std::FILE* const file = std::fopen(argv[2], "wb");
    if (!file) return 2;
    std::fwrite(out.data(), sizeof(std::uint32_t), out.size(), file);
    std::fclose(file);
    write_coverage("stage_bench");
    return 0;
}
