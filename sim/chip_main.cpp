// The whole chip (rtds_chip) between behavioural converters and a serial line, at the other end of a socket.
//
// Purpose    What is around the chip's pins in a run: an LTC2308 whose inputs are voltages, a DAC7624 whose outputs are
//            codes, a serial line, the board's clock and the PLL's two. No Python, no VPI: the host speaks to this
//            program in the frames of rtds_host.link.protocol (kinds CHIP_RUN, CHIP_RAN).
// Converters Behaviour only, on the pins: word of six bits on rising SCK selects the next conversion, bit 11 stands
//            before the first clock, the rest follow falling SCK, the first conversion after power-up is of no known
//            channel; the DAC has two ranks of latches. Their times are checked elsewhere (tb/agents), not here.
// Clocks     50 MHz, 40 MHz, and CONVST's 40 MHz. Nothing in the chip depends on the falling edge of the first
//            and the last: those levels change together with another clock's edge, and CONVST's clock rises 12.5 ns
//            after the 40 MHz (on the board 7.5; CONVST still comes 1592.5 ns before the first SCK). 13 evaluations a
//            100 ns.
// Idle       With `every_clock` 0 clocks of 50 MHz are left out while the pins show that nothing is in hand: IDLE_CLOCKS
//            (with `every_clock` 2, for effects, FX_IDLE_CLOCKS) after an LDAC pulse and until the last conversion of a sequence (channel 1) is read out, and only while
//            the serial line is at rest. Counters of clocks in the chip then count less; codes do not change.
// Requests   CHIP_RUN: run until `steps` more LDAC edges and, where `expect` is not 0, until so many bytes came back
//            on the serial line, or until `limit_ns` has passed. The pins' voltages act at once: a run ends
//            with an LDAC edge, before the next sequence samples voltages and torques.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include <unistd.h>

#include "Vtop.h"
#include "Vtop___024root.h"
#include "verilated.h"

void Vtop___024root___eval(Vtop___024root* root);  // defined by the generated code, declared in no header

namespace {

constexpr unsigned VERSION = 2;
enum : std::uint32_t { HELLO = 1, CLOSE = 6, FAILED = 7, CHIP_RUN = 8, CHIP_RAN = 9 };
enum : std::uint32_t { FLAG_TIMEOUT = 1, FLAG_RESET = 2 };

constexpr double LSB_V = 1e-3;
constexpr int CODES = 4096;
constexpr int BIT_CLOCKS = 50;     // 1 Mbaud
constexpr int IDLE_CLOCKS = 100;   // after LDAC: the chip has been busy for 127 since the record, LDAC comes after 60 to 75
constexpr int FX_IDLE_CLOCKS = 300;  // with effects: the core is ready again 50 or, with new parameters, 271 after its strobe
constexpr int LAST_CHANNEL = 1;    // of a sequence: V_R
constexpr std::uint64_t RESET_PS = 1000000;
constexpr std::size_t MAX_PAYLOAD = 1u << 20;

#pragma pack(push, 1)
struct Header {
    std::uint32_t kind, length;
};
struct Run {
    double pins_v[8];
    std::uint32_t steps, sample_steps, expect, every_clock;
    std::uint64_t limit_ns;
    // then the bytes to send on the serial line
};
struct Ran {
    std::uint32_t flags, steps;
    std::uint64_t time_ps, clocks;
    std::uint32_t serial_bytes, rows;
    // then the bytes that came, then rows of four uint16 codes
};
#pragma pack(pop)

bool read_all(int fd, void* to, std::size_t count) {
    auto* at = static_cast<char*>(to);
    while (count > 0) {
        const ssize_t got = read(fd, at, count);
        if (got <= 0) return false;
        at += got;
        count -= static_cast<std::size_t>(got);
    }
    return true;
}

bool write_all(int fd, const void* from, std::size_t count) {
    const auto* at = static_cast<const char*>(from);
    while (count > 0) {
        const ssize_t put = write(fd, at, count);
        if (put <= 0) return false;
        at += put;
        count -= static_cast<std::size_t>(put);
    }
    return true;
}

bool send_frame(int fd, std::uint32_t kind, const std::string& payload) {
    const Header header{kind, static_cast<std::uint32_t>(payload.size())};
    return write_all(fd, &header, sizeof header) && write_all(fd, payload.data(), payload.size());
}

class Adc {
   public:
    double pins_v[8] = {};
    bool last_read_out = false;  // the last conversion of a sequence has been read to its end

    // Looks at the pins after an evaluation; returns the level of SDO.
    bool look(bool convst, bool sck, bool sdi) {
        if (convst && !convst_) {
            result_ = known_ ? code(pins_v[channel_]) : 0xBAD;
            converting_ = known_ ? channel_ : -1;
            falls_ = 0;
            rises_ = 0;
        }
        if (sck && !sck_ && rises_ < 6) {
            word_ = (word_ << 1 | sdi) & 63;
            if (++rises_ == 6) {  // S/D O/S S1 S0 UNI SLP: single ended, unipolar, awake
                known_ = (word_ & 0x23) == 0x22;
                channel_ = (word_ >> 2 & 3) << 1 | (word_ >> 4 & 1);
            }
        }
        if (!sck && sck_ && ++falls_ == 12) last_read_out = converting_ == LAST_CHANNEL;
        convst_ = convst;
        sck_ = sck;
        return falls_ < 12 && (result_ >> (11 - falls_) & 1);
    }

   private:
    static int code(double volts) {
        const double steps = std::nearbyint(volts / LSB_V);
        return steps >= 0 ? static_cast<int>(std::min(steps, CODES - 1.0)) : 0;  // and 0 for what is no number
    }

    bool convst_ = false, sck_ = false, known_ = false;
    int result_ = 0, falls_ = 12, rises_ = 0, word_ = 0, channel_ = 0, converting_ = -1;
};

class Dac {
   public:
    std::uint16_t codes[4] = {2048, 2048, 2048, 2048};
    std::uint32_t updates = 0;

    // Looks at the pins after an evaluation; true when LDAC fell.
    bool look(const Vtop& top) {
        if (!top.dac_reset_no) {
            std::fill_n(inputs_, 4, 2048);
            std::fill_n(codes, 4, 2048);
            ldac_ = false;
            return false;
        }
        if (!top.dac_cs_no && !top.dac_rw_o) inputs_[top.dac_a_o] = top.dac_db_o;
        const bool falls = !top.dac_ldac_no && !ldac_;
        ldac_ = !top.dac_ldac_no;
        if (ldac_) std::copy_n(inputs_, 4, codes);
        updates += falls;
        return falls;
    }

   private:
    std::uint16_t inputs_[4] = {2048, 2048, 2048, 2048};
    bool ldac_ = false;
};

// 8N1, one call a clock of 50 MHz.
class Serial {
   public:
    std::deque<std::uint8_t> to_send;
    std::string received;
    int pending = 0;  // bytes that are still expected

    bool at_rest() const { return to_send.empty() && !sending_ && !receiving_ && pending == 0; }

    bool line() const { return level_; }

    void clock(bool from_chip) {
        if (!sending_ && !to_send.empty()) {
            shift_ = 0x200u | to_send.front() << 1;  // stop, data, start
            to_send.pop_front();
            sending_ = 10 * BIT_CLOCKS;
        }
        if (sending_) {
            level_ = shift_ >> ((10 * BIT_CLOCKS - sending_) / BIT_CLOCKS) & 1;
            --sending_;
        } else {
            level_ = true;
        }
        if (receiving_) {
            --receiving_;
            const int bit = (10 * BIT_CLOCKS - receiving_) / BIT_CLOCKS;
            if ((10 * BIT_CLOCKS - receiving_) % BIT_CLOCKS == BIT_CLOCKS / 2) {
                if (bit >= 1 && bit <= 8) byte_ = byte_ >> 1 | (from_chip ? 0x80 : 0);
                if (bit == 9) {
                    if (from_chip) received.push_back(static_cast<char>(byte_));
                    if (pending > 0) --pending;
                    receiving_ = 0;
                }
            }
        } else if (!from_chip) {
            receiving_ = 10 * BIT_CLOCKS;
            byte_ = 0;
        }
    }

   private:
    bool level_ = true;
    unsigned shift_ = 0, byte_ = 0;
    int sending_ = 0, receiving_ = 0;
};

class Harness {
   public:
    explicit Harness(int fd) : fd_(fd), owner_(new Vtop("")), top_(*owner_), root_(owner_->rootp) {
        top_.uart_rx_i = 1;
        top_.eval();
    }

    void serve() {
        if (!send_frame(fd_, HELLO,
                        "{\"version\": " + std::to_string(VERSION) + ", \"top\": \"rtds_chip\", \"simulator\": \"Verilator " +
                            std::string(Verilated::productVersion()) + "\"}"))
            return;
        Header header;
        while (read_all(fd_, &header, sizeof header)) {
            std::string payload(std::min<std::size_t>(header.length, MAX_PAYLOAD), '\0');
            if (header.length > MAX_PAYLOAD || !read_all(fd_, payload.data(), payload.size())) return;
            if (header.kind == CLOSE) return;
            const bool good = header.kind == CHIP_RUN && payload.size() >= sizeof(Run);
            if (!(good ? send_frame(fd_, CHIP_RAN, run(payload)) : send_frame(fd_, FAILED, "request unknown to the chip's harness")))
                return;
        }
    }

   private:
    void evaluate() { Vtop___024root___eval(root_); }

    void adc_rises() {
        top_.clk_adc_i = 1;
        top_.clk_cnv_i = 0;
        top_.clk_sys_i = 0;
        evaluate();
        top_.adc_sdo_i = adc_.look(top_.adc_convst_o, top_.adc_sck_o, top_.adc_sdi_o);
    }

    void adc_falls() {
        top_.clk_adc_i = 0;
        top_.clk_cnv_i = 1;
        top_.clk_sys_i = 0;
        evaluate();
        top_.adc_sdo_i = adc_.look(top_.adc_convst_o, top_.adc_sck_o, top_.adc_sdi_o);
    }

    // True when LDAC fell.
    bool sys_rises() {
        if (idle_) {
            if (!adc_.last_read_out && serial_.at_rest() && !every_clock_) return false;
            idle_ = false;
        }
        if (!serial_.at_rest() || !top_.uart_tx_o) {
            serial_.clock(top_.uart_tx_o);
            top_.uart_rx_i = serial_.line();
        }
        top_.clk_sys_i = 1;
        evaluate();
        ++clocks_;
        const bool done = dac_.look(top_);
        if (done) {
            since_ldac_ = 0;
            adc_.last_read_out = false;
        } else if (++since_ldac_ > idle_clocks_ && !every_clock_) {
            idle_ = !adc_.last_read_out && serial_.at_rest() && dac_.updates > 1;
        }
        return done;
    }

    // The next of the 13 events of 100 ns; true when LDAC fell.
    bool advance() {
        bool done = false;
        switch (EVENTS[slot_].what) {
            case 's': done = sys_rises(); break;
            case 'u': adc_rises(); break;
            default: adc_falls(); break;
        }
        now_ps_ = round_ps_ + EVENTS[slot_].at_ps;
        if (++slot_ == 13) {
            slot_ = 0;
            round_ps_ += 100000;
        }
        return done;
    }

    std::string run(const std::string& payload) {
        Run ask;
        std::memcpy(&ask, payload.data(), sizeof ask);
        std::copy_n(ask.pins_v, 8, adc_.pins_v);
        every_clock_ = ask.every_clock == 1;
        idle_clocks_ = ask.every_clock == 2 ? FX_IDLE_CLOCKS : IDLE_CLOCKS;
        for (std::size_t k = sizeof ask; k < payload.size(); ++k) serial_.to_send.push_back(static_cast<std::uint8_t>(payload[k]));
        serial_.pending += static_cast<int>(ask.expect);
        serial_.received.clear();
        if (round_ps_ == 0) {
            while (now_ps_ < RESET_PS) advance();
            top_.ext_rst_ni = 1;
            top_.pll_locked_i = 1;
        }
        const std::uint64_t end_ps = now_ps_ + ask.limit_ns * 1000;
        const bool wait_serial = ask.expect != 0 && ask.steps == 0;
        std::uint32_t left = ask.steps, to_sample = ask.sample_steps, flags = 0;
        std::vector<std::uint16_t> rows;
        while (left > 0 || (wait_serial && serial_.pending > 0)) {
            if (now_ps_ >= end_ps) {
                flags |= FLAG_TIMEOUT;
                break;
            }
            if (!advance() || left == 0) continue;
            --left;
            if (--to_sample == 0 || left == 0) {
                rows.insert(rows.end(), dac_.codes, dac_.codes + 4);
                to_sample = ask.sample_steps;
            }
        }
        if (ask.steps == 0) {  // end like all others, right after an LDAC edge
            const std::uint64_t grace_ps = now_ps_ + 30000000;
            while (now_ps_ < grace_ps && !advance()) {
            }
        }
        if (serial_.pending > 0 && flags & FLAG_TIMEOUT) serial_.pending = 0;
        if (!top_.dac_reset_no) flags |= FLAG_RESET;
        if (ask.sample_steps == 0) rows.assign(dac_.codes, dac_.codes + 4);
        const Ran head{flags, dac_.updates, now_ps_, clocks_, static_cast<std::uint32_t>(serial_.received.size()),
                       static_cast<std::uint32_t>(rows.size() / 4)};
        std::string answer(reinterpret_cast<const char*>(&head), sizeof head);
        answer += serial_.received;
        answer.append(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof rows[0]);
        return answer;
    }

    struct Event {
        char what;
        std::uint64_t at_ps;
    };
    // s: 50 MHz rises. u: 40 MHz rises (and CONVST's clock falls). d: 40 MHz falls, CONVST's clock rises.
    static constexpr Event EVENTS[13] = {{'s', 0},     {'u', 3000},  {'d', 15500}, {'s', 20000}, {'u', 28000},
                                         {'s', 40000}, {'d', 40500}, {'u', 53000}, {'s', 60000}, {'d', 65500},
                                         {'u', 78000}, {'s', 80000}, {'d', 90500}};

    int fd_;
    std::unique_ptr<Vtop> owner_;
    Vtop& top_;
    Vtop___024root* root_;
    Adc adc_;
    Dac dac_;
    Serial serial_;
    std::uint64_t now_ps_ = 0, round_ps_ = 0, clocks_ = 0;
    unsigned slot_ = 0, since_ldac_ = 0;
    bool idle_ = false, every_clock_ = true;
    int idle_clocks_ = IDLE_CLOCKS;
};

constexpr Harness::Event Harness::EVENTS[13];

}  // namespace

int main(int argc, char** argv) {
    Verilated::commandArgs(argc, argv);
    const char* descriptor = std::getenv("RTDS_LINK_FD");
    if (descriptor == nullptr) {
        std::fprintf(stderr, "RTDS_LINK_FD is not set: this program is started by the host\n");
        return 1;
    }
    Harness(std::atoi(descriptor)).serve();
    return 0;
}
