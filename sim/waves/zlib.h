// The part of zlib's interface that Verilator's writer of FST files calls, without compression: a valid zlib stream (RFC 1950)
// of stored blocks (RFC 1951, 3.2.4). The writer keeps what it gave where that is not longer, which it never is here. So a
// simulator that writes waveforms needs no package of the system; the compression that matters is the one in lz4.h.
#ifndef RTDS_WAVES_ZLIB_H
#define RTDS_WAVES_ZLIB_H
#include <cstddef>
#include <cstdint>
#include <cstring>

typedef unsigned char Bytef;
typedef unsigned long uLong;
typedef unsigned long uLongf;
enum { Z_OK = 0, Z_BUF_ERROR = -5 };

inline uLong compressBound(uLong count) { return count + 5 * (count / 65535 + 1) + 6; }

// Adler-32, RFC 1950.
inline std::uint32_t rtds_adler32(const Bytef* from, uLong count) {
    std::uint32_t low = 1, high = 0;
    for (uLong k = 0; k < count; ++k) {
        low = (low + from[k]) % 65521;
        high = (high + low) % 65521;
    }
    return high << 16 | low;
}

inline int compress2(Bytef* to, uLongf* room, const Bytef* from, uLong count, int) {
    if (*room < compressBound(count)) return Z_BUF_ERROR;
    Bytef* at = to;
    *at++ = 0x78;
    *at++ = 0x01;
    uLong done = 0;
    do {
        const uLong left = count - done;
        const std::uint16_t piece = left > 65535 ? 65535 : static_cast<std::uint16_t>(left);
        *at++ = done + piece == count;  // the last block?
        *at++ = piece & 0xFF;
        *at++ = piece >> 8;
        *at++ = ~piece & 0xFF;
        *at++ = (~piece >> 8) & 0xFF;
        if (piece) std::memcpy(at, from + done, piece);
        at += piece;
        done += piece;
    } while (done < count);
    const std::uint32_t sum = rtds_adler32(from, count);
    for (int shift = 24; shift >= 0; shift -= 8) *at++ = static_cast<Bytef>(sum >> shift);
    *room = static_cast<uLongf>(at - to);
    return Z_OK;
}

#endif
