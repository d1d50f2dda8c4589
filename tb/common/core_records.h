// Where the fields of rtds_core's records stand, for the benches in C++: the Verilog header's own lines, which are C++, too, but for
// two words. And what both benches of the core put on its ports.
#pragma once

#include <cstdint>

#define localparam constexpr
#define integer int
#include "../../rtl/core/rtds_core_records.vh"
#undef localparam
#undef integer

constexpr int INPUTS[] = {INPUTS_V_L, INPUTS_V_R, INPUTS_T_L, INPUTS_T_R};
constexpr int MOTOR[] = {MOTOR_R, MOTOR_L, MOTOR_KM, MOTOR_KB, MOTOR_J, MOTOR_B};
constexpr int STATE[] = {STATE_I_L, STATE_W_L, STATE_I_R, STATE_W_R};

// Words in the order of these lists, into a record and out of it. Each begins where one of the record's words does.
template <class Record, int N>
void put(Record& record, const int (&places)[N], const std::uint32_t* words) {
    for (int k = 0; k < N; ++k) record[places[k] / 32] = words[k];
}

template <class Record, int N>
void get(const Record& record, const int (&places)[N], std::uint32_t* words) {
    for (int k = 0; k < N; ++k) words[k] = record[places[k] / 32];
}

inline std::uint64_t settings(std::uint32_t h, std::uint64_t method, std::uint64_t on, std::uint64_t own, std::uint64_t delay,
                              std::uint64_t stride) {
    return std::uint64_t{h} << SETTINGS_H | (method & 1) << SETTINGS_METHOD | (on & 1) << SETTINGS_FX_ON |
           (own & 1) << SETTINGS_FX_OWN | (delay & 0xFFF) << SETTINGS_DELAY | (stride & 0xFFFF) << SETTINGS_STRIDE;
}
