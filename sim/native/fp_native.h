// The operators of rtl/fp by the host's own arithmetic, for compiled simulation.
//
// IEEE 754 leaves one result for a sum and for a product of binary32, whichever way it is computed: round to nearest even,
// subnormals in and out. Only a NaN's payload is free, and here it is the canonical one, as in rtl/fp. What that needs of the
// host: binary32 evaluated as such (FLT_EVAL_METHOD 0), no fused multiply-add (-ffp-contract=off), rounding to nearest and no
// flushing to zero. The last two are modes of the processor, and a library that is loaded may change them: the main sets
// them before it goes on (rtds_fp_modes), and ends if the operators do not give known results (rtds_fp_works).
#pragma once
#include <cfenv>
#include <cfloat>
#include <cstdint>
#include <cstring>

static_assert(FLT_EVAL_METHOD == 0, "sums and products of binary32 must be evaluated in binary32");
static_assert(sizeof(float) == 4 && FLT_MANT_DIG == 24 && FLT_MAX_EXP == 128, "float must be binary32");
#ifdef __FAST_MATH__
#error "the operators need IEEE 754 arithmetic, not -ffast-math"
#endif

static inline float rtds_float(std::uint32_t word) {
    float value;
    std::memcpy(&value, &word, sizeof value);
    return value;
}
static inline std::uint32_t rtds_word(float value) {
    std::uint32_t word;
    std::memcpy(&word, &value, sizeof word);
    return value != value ? 0x7FC00000u : word;
}
static inline std::uint32_t rtds_add(std::uint32_t a, std::uint32_t b) { return rtds_word(rtds_float(a) + rtds_float(b)); }
static inline std::uint32_t rtds_mul(std::uint32_t a, std::uint32_t b) { return rtds_word(rtds_float(a) * rtds_float(b)); }

// Rounding to nearest even, subnormals kept, no traps.
static inline void rtds_fp_modes() { std::fesetenv(FE_DFL_ENV); }

// Whether the operators do what rtl/fp does where processors or modes could differ. Not instead of the test against rtl/fp.
static inline bool rtds_fp_works() {
    struct Known {
        std::uint32_t a, b, sum, product;
    };
    static const volatile Known known[] = {
        {0x3F800001u, 0x33800000u, 0x3F800002u, 0x33800001u},  // a tie, to even: up
        {0x3F800000u, 0x33800000u, 0x3F800000u, 0x33800000u},  // a tie, to even: down
        {0x00000001u, 0x00000001u, 0x00000002u, 0x00000000u},  // subnormals in and out
        {0x00800001u, 0x80800000u, 0x00000001u, 0x80000000u},
        {0x00800000u, 0x3F000000u, 0x3F000000u, 0x00400000u},  // a product that becomes subnormal
        {0x7F7FFFFFu, 0x7F7FFFFFu, 0x7F800000u, 0x7F800000u},  // overflow
        {0x7F800000u, 0xFF800000u, 0x7FC00000u, 0xFF800000u},  // NaN from infinities
        {0x7F812345u, 0x00000000u, 0x7FC00000u, 0x7FC00000u},  // a NaN's payload goes
        {0x3F800000u, 0xBF800000u, 0x00000000u, 0xBF800000u},  // exact zero is +0
        {0x80000000u, 0x80000000u, 0x80000000u, 0x00000000u},
    };
    for (const volatile Known& k : known)
        if (rtds_add(k.a, k.b) != k.sum || rtds_mul(k.a, k.b) != k.product) return false;
    return true;
}
