// Drives rtds_core from a binary script and writes every step's words.
//
//   Vrtds_core <script.bin> <out.bin> <extra>
//
// script: records of 14 uint32: v_l v_r t_l t_r, p_r p_l p_km p_kb p_j p_b p_h, method, strobes, clear.
//   clear = 1: clear_i for one clock before the first strobe of the record.
// out: for each strobe 9 uint32: i_l w_l i_r w_r, their low words, {param_fault, nonfinite}, read when ready_o is back.
// extra: clocks waited beyond ready_o before each strobe, at most; drawn anew for each.
//
// Between strobes the inputs carry random words: only the strobe's edge may count. Ends with status 1 when a step does
// not keep the documented latencies.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "Vrtds_core.h"
#include "../common/clocked.h"
#include "../common/core_records.h"
#include "../common/coverage.h"
#include "verilated.h"

namespace {

constexpr int VALID_CLOCKS = 11;
constexpr int READY_CLOCKS = 26;
constexpr int READY_LIMIT = 400;

void drive(Vrtds_core& top, const std::uint32_t* record) {
    put(top.inputs_i, INPUTS, record);
    put(top.motor_l_i, MOTOR, record + 4);
    top.settings_i = settings(record[10], record[11], 0, 0, 0, 0);
}

void scramble(Vrtds_core& top) {
    std::uint32_t words[12];
    for (std::uint32_t& word : words) word = random_word();
    drive(top, words);
    // Without effects at the strobe, nothing of them counts.
    const std::uint64_t on = random_word(), own = random_word(), delay = random_word(), stride = random_word();
    top.settings_i = settings(words[10], words[11], on, own, delay, stride);
    for (std::uint32_t& word : words) word = random_word();
    put(top.motor_r_i, MOTOR, words);
}

int fail(long step, const char* what, int clocks) {
    std::fprintf(stderr, "step %ld: %s after %d clocks\n", step, what, clocks);
    return 1;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    Verilated::randReset(2);
    Verilated::randSeed(17);
    auto core = std::make_unique<Vrtds_core>();
    Vrtds_core& top = *core;
    const unsigned extra = static_cast<unsigned>(std::atoi(argv[3]));
    std::FILE* in = std::fopen(argv[1], "rb");
    std::FILE* out = std::fopen(argv[2], "wb");
    if (!in || !out) return 2;

    top.clk_i = 0;
    top.rst_ni = 0;
    top.strobe_i = 0;
    top.clear_i = 0;
    top.word_valid_i = 0;
    top.eval();
    edge(top);
    top.rst_ni = 1;
    top.eval();

    long step = 0;
    for (std::uint32_t record[14]; std::fread(record, sizeof record, 1, in) == 1;) {
        if (record[13]) {
            top.clear_i = 1;
            edge(top);
            top.clear_i = 0;
        }
        for (std::uint32_t strobe = 0; strobe < record[12]; ++strobe, ++step) {
            for (unsigned wait = extra ? random_word() % (extra + 1) : 0; wait > 0; --wait) edge(top);
            drive(top, record);
            top.strobe_i = 1;
            edge(top);
            top.strobe_i = 0;
            scramble(top);
            top.eval();
            int clocks = 0;
            bool valid = false;
            for (; !top.ready_o; ++clocks) {
                edge(top);
                if (top.valid_o != (clocks + 1 == VALID_CLOCKS)) return fail(step, "valid_o wrong", clocks + 1);
                valid |= top.valid_o;
                if (clocks > READY_LIMIT) return fail(step, "not ready", clocks);
            }
            if (!valid) return fail(step, "ready before valid_o", clocks);
            if (strobe > 0 && clocks + 1 != READY_CLOCKS) return fail(step, "ready for the next strobe", clocks + 1);
            if (top.overrun_o) return fail(step, "overrun_o", clocks);
            // The edge that could take the next strobe settles the last low words, if they were not yet.
            std::uint32_t words[9];
            get(top.state_o, STATE, words);
            get(top.low_o, STATE, words + 4);
            words[8] = static_cast<std::uint32_t>(top.param_fault_o << 1 | top.nonfinite_o);
            std::fwrite(words, sizeof words, 1, out);
        }
    }
    std::fclose(in);
    write_coverage("core_bench");
    return std::fclose(out) == 0 ? 0 : 2;
}
