// Drives fp_bench from a binary file of operand pairs and writes what each operator gives at its stated latency.
//
//   Vfp_bench <pairs.bin> <out.bin> <stall>
//
// pairs: uint32 a, b; out: for each pair uint32 add, sub, mul, div, from_int, from_fix16, from_fix63, to_int, to_fix16,
// to_fix31, flags of the last three.
// stall: 0 = the clock enable is always on; else it is off in about one clock of <stall>, with other operands on
// the inputs, so that a pipeline that does not freeze gives wrong results.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <vector>

#include "Vfp_bench.h"
#include "../common/coverage.h"
#include "verilated.h"

namespace {

constexpr int ADD_LATENCY = 3;
constexpr int MUL_LATENCY = 3;
constexpr int INT_LATENCY = 2;
constexpr int DIV_LATENCY = 32;
constexpr int RESULTS = 11;

std::uint64_t random_state = 88172645463325252ull;
std::uint64_t next_random() {
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

struct Bench {
    Vfp_bench top;
    unsigned stall;

    void edge() {
        top.clk_i = 1;
        top.eval();
        top.clk_i = 0;
        top.eval();
    }

    // One enabled clock, with frozen clocks before it now and then.
    void clock(std::uint32_t a, std::uint32_t b, bool start) {
        while (stall != 0 && next_random() % stall == 0) {
            top.en_i = 0;
            top.start_i = static_cast<CData>(next_random() & 1);
            top.a_i = static_cast<std::uint32_t>(next_random());
            top.b_i = static_cast<std::uint32_t>(next_random());
            edge();
        }
        top.en_i = 1;
        top.start_i = start;
        top.a_i = a;
        top.b_i = b;
        edge();
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    Verilated::randReset(2);
    Verilated::randSeed(11);
    auto bench = std::make_unique<Bench>();
    bench->stall = static_cast<unsigned>(std::atoi(argv[3]));

    std::vector<std::uint32_t> pairs;
    std::FILE* in = std::fopen(argv[1], "rb");
    if (!in) return 2;
    for (std::uint32_t pair[2]; std::fread(pair, sizeof pair, 1, in) == 1;) pairs.insert(pairs.end(), pair, pair + 2);
    std::fclose(in);
    const long n = static_cast<long>(pairs.size() / 2);
    std::vector<std::uint32_t> out(static_cast<std::size_t>(n) * RESULTS);

    Vfp_bench& top = bench->top;
    top.rst_ni = 0;
    top.clk_i = 0;
    top.eval();
    bench->clock(0, 0, false);
    top.rst_ni = 1;

    // One pair a clock through the pipelines: after clock k the result of pair k - (latency - 1) stands.
    for (long k = 0; k < n + ADD_LATENCY; ++k) {
        const bool real = k < n;
        bench->clock(real ? pairs[2 * k] : 0, real ? pairs[2 * k + 1] : 0, false);
        const long add = k - (ADD_LATENCY - 1), mul = k - (MUL_LATENCY - 1), integer = k - (INT_LATENCY - 1);
        if (add >= 0 && add < n) {
            out[RESULTS * add] = top.add_o;
            out[RESULTS * add + 1] = top.sub_o;
        }
        if (mul >= 0 && mul < n) out[RESULTS * mul + 2] = top.mul_o;
        if (integer >= 0 && integer < n) {
            const std::uint32_t words[] = {top.from_int_o, top.from_fix16_o, top.from_fix63_o, top.to_int_o,
                                           top.to_fix16_o, top.to_fix31_o,   top.to_flags_o};
            std::copy(std::begin(words), std::end(words), out.begin() + RESULTS * integer + 4);
        }
    }

    for (long k = 0; k < n; ++k) {
        bench->clock(pairs[2 * k], pairs[2 * k + 1], true);
        for (int latency = 1; latency < DIV_LATENCY; ++latency) {
            if (top.div_valid_o) {
                std::fprintf(stderr, "fp_div: valid after %d clocks, not %d\n", latency, DIV_LATENCY);
                return 1;
            }
            bench->clock(0, 0, false);
        }
        if (!top.div_valid_o) {
            std::fprintf(stderr, "fp_div: not valid after %d clocks\n", DIV_LATENCY);
            return 1;
        }
        out[RESULTS * k + 3] = top.div_o;
    }

    std::FILE* file = std::fopen(argv[2], "wb");
    if (!file) return 2;
    std::fwrite(out.data(), sizeof(std::uint32_t), out.size(), file);
    std::fclose(file);
    write_coverage("fp_bench");
    return 0;
}
