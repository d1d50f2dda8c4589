// The part of LZ4's interface that Verilator's writer of FST files calls: a compressor of LZ4 blocks, written from the format's
// description (github.com/lz4/lz4, doc/lz4_Block_format.md). So a simulator that writes waveforms needs no package of the system.
//
// A sequence is a token (length of the literals, length of the match less 4), the literals, two bytes of offset. The last
// sequence has literals only; the last match begins at least 12 bytes before the end, and the last 5 bytes are literals.
#ifndef RTDS_WAVES_LZ4_H
#define RTDS_WAVES_LZ4_H
#include <cstdint>
#include <cstring>
#include <vector>

inline int LZ4_compressBound(int count) { return count < 0 ? 0 : count + count / 255 + 16; }

namespace rtds_lz4 {

constexpr int least_match = 4, match_limit = 12, last_literals = 5, farthest = 65535, table_bits = 14;

inline std::uint32_t word_at(const std::uint8_t* from) {
    std::uint32_t word;
    std::memcpy(&word, from, sizeof word);
    return word;
}

// The part of a length that does not fit into the token's four bits.
inline std::uint8_t* put_length(std::uint8_t* to, int rest) {
    for (; rest >= 255; rest -= 255) *to++ = 255;
    *to++ = static_cast<std::uint8_t>(rest);
    return to;
}

inline std::uint8_t* put_sequence(std::uint8_t* to, const std::uint8_t* literals, int count, int offset, int match) {
    std::uint8_t* const token = to++;
    *token = static_cast<std::uint8_t>((count < 15 ? count : 15) << 4);
    if (count >= 15) to = put_length(to, count - 15);
    if (count) std::memcpy(to, literals, static_cast<std::size_t>(count));
    to += count;
    if (match == 0) return to;
    *to++ = offset & 0xFF;
    *to++ = static_cast<std::uint8_t>(offset >> 8);
    const int beyond = match - least_match;
    *token |= beyond < 15 ? beyond : 15;
    return beyond >= 15 ? put_length(to, beyond - 15) : to;
}

}  // namespace rtds_lz4

// Bytes written, or 0 where there is no room for the worst case.
inline int LZ4_compress_default(const char* source, char* target, int count, int room) {
    using namespace rtds_lz4;
    if (count < 0 || room < LZ4_compressBound(count)) return 0;
    const auto* const from = reinterpret_cast<const std::uint8_t*>(source);
    auto* const to = reinterpret_cast<std::uint8_t*>(target);
    std::uint8_t* at = to;
    std::vector<int> seen(1u << table_bits, -1);  // where a hash of four bytes was last
    int begun = 0, k = 0;
    while (k < count - match_limit) {
        const std::uint32_t word = word_at(from + k);
        int& last = seen[(word * 2654435761u) >> (32 - table_bits)];
        const int before = last;
        last = k;
        if (before < 0 || k - before > farthest || word_at(from + before) != word) {
            ++k;
            continue;
        }
        int match = least_match;
        while (k + match < count - last_literals && from[before + match] == from[k + match]) ++match;
        at = put_sequence(at, from + begun, k - begun, k - before, match);
        k += match;
        begun = k;
    }
    at = put_sequence(at, from + begun, count - begun, 0, 0);
    return static_cast<int>(at - to);
}

#endif
