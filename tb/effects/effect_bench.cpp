// Drives rtds_core with effects from a binary script and writes every step's words.
//
//   Vrtds_core <script.bin> <out.bin> <extra>
//
// script: records that begin with their kind.
//   0: n, then n times address, word: written through the port of the effect unit, each as soon as it is taken.
//   1: v_l v_r t_l t_r, p_r p_l p_km p_kb p_j p_b p_h, p2_r p2_l p2_km p2_kb p2_j p2_b, method, on, own, delay, stride,
//      strobes, clear.
//   clear: clear_i for one clock before the first strobe of the record.
// out: for each strobe 9 uint32: i_l w_l i_r w_r, their low words, {param_fault, nonfinite}, read when ready_o is back.
// extra: clocks waited beyond ready_o before each strobe, at most; drawn anew for each.
//
// Between strobes inputs and configuration carry random words: only the strobe's edge may count (the delay's numbers hold,
// as they do on the chip). Ends with status 1 when a step does not keep the documented latencies.
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

constexpr int FIELDS = 24;
constexpr int VALID_CLOCKS[2] = {11, 15};
constexpr int READY_CLOCKS[2] = {26, 50};
constexpr int READY_LIMIT = 400;

// A record of the script; delay and stride are those of the whole record, also between strobes.
void drive(Vrtds_core& top, const std::uint32_t* record, std::uint32_t delay, std::uint32_t stride) {
    put(top.inputs_i, INPUTS, record);
    put(top.motor_l_i, MOTOR, record + 4);
    put(top.motor_r_i, MOTOR, record + 11);
    top.settings_i = settings(record[10], record[17], record[18], record[19], delay, stride);
}

void scramble(Vrtds_core& top, std::uint32_t delay, std::uint32_t stride) {
    std::uint32_t words[20];
    for (std::uint32_t& word : words) word = random_word();
    drive(top, words, delay, stride);
}

void put_word(Vrtds_core& top, std::uint32_t address, std::uint32_t data) {
    top.word_i = std::uint64_t{address & 0x3FFF} << WORD_ADDRESS | std::uint64_t{data} << WORD_DATA;
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
    for (std::uint32_t kind; std::fread(&kind, sizeof kind, 1, in) == 1;) {
        if (kind == 0) {
            std::uint32_t count;
            if (std::fread(&count, sizeof count, 1, in) != 1) return 2;
            for (std::uint32_t k = 0; k < count; ++k) {
                std::uint32_t pair[2];
                if (std::fread(pair, sizeof pair, 1, in) != 1) return 2;
                if (!top.word_ready_o) return fail(step, "no room for a word", 0);
                put_word(top, pair[0], pair[1]);
                top.word_valid_i = 1;
                edge(top);
                top.word_valid_i = 0;
                const std::uint32_t address = random_word();
                put_word(top, address, random_word());
                edge(top);
            }
            continue;
        }
        std::uint32_t record[FIELDS];
        if (std::fread(record, sizeof record, 1, in) != 1) return 2;
        const int on = record[18] & 1;
        scramble(top, record[20], record[21]);
        if (record[23]) {
            top.clear_i = 1;
            edge(top);
            top.clear_i = 0;
        }
        for (std::uint32_t strobe = 0; strobe < record[22]; ++strobe, ++step) {
            for (unsigned wait = extra ? random_word() % (extra + 1) : 0; wait > 0; --wait) edge(top);
            drive(top, record, record[20], record[21]);
            top.strobe_i = 1;
            edge(top);
            top.strobe_i = 0;
            scramble(top, record[20], record[21]);
            top.eval();
            int clocks = 0;
            bool valid = false;
            for (; !top.ready_o; ++clocks) {
                edge(top);
                if (top.valid_o != (clocks + 1 == VALID_CLOCKS[on])) return fail(step, "valid_o wrong", clocks + 1);
                valid |= top.valid_o;
                if (clocks > READY_LIMIT) return fail(step, "not ready", clocks);
            }
            if (!valid) return fail(step, "ready before valid_o", clocks);
            if (strobe > 0 && clocks + 1 != READY_CLOCKS[on]) return fail(step, "ready for the next strobe", clocks + 1);
            if (top.overrun_o) return fail(step, "overrun_o", clocks);
            std::uint32_t words[9];
            get(top.state_o, STATE, words);
            get(top.low_o, STATE, words + 4);
            words[8] = static_cast<std::uint32_t>(top.param_fault_o << 1 | top.nonfinite_o);
            std::fwrite(words, sizeof words, 1, out);
        }
    }
    std::fclose(in);
    write_coverage("effect_bench");
    return std::fclose(out) == 0 ? 0 : 2;
}
