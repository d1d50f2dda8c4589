// Main of the simulator of rtds_hps: an AXI master that carries out the host's reads and writes, one a time.
//
// The host sends a count, then so many {operation, address, data} of 32 bits each (little-endian); the answer is as many
// {response, data, clocks the transaction took}. Operations: 0 read, 1 write, 2 let `data` clocks pass, 3 read until the bits of
// `data` are zero there (clocks pass between; the answer's data are the word). The socket's number stands in RTDS_LINK_FD.
//
// With RTDS_HPS_STALLS=N in the environment the master is late now and then, one in N clocks in the mean, with each ready and
// with the data of a write. The transactions' clocks are then no figures of the slave.
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "Vtop.h"
#include "verilated.h"
#ifdef RTDS_NATIVE
#include "fp_native.h"
#endif

namespace {

std::uint64_t clocks = 0;
unsigned stalls = 0;
std::uint64_t random_state = 88172645463325252ull;
constexpr std::uint32_t GIVE_UP = 100000000;  // clocks

bool late() {
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return stalls != 0 && random_state % stalls != 0;
}

void edge(Vtop& top) {
    top.clk_i = 1;
    top.eval();
    top.clk_i = 0;
    top.eval();
    ++clocks;
}

struct Answer {
    std::uint32_t response, data, clocks;
};

[[noreturn]] void hung(const char* what) {
    std::fprintf(stderr, "the slave gives no %s\n", what);
    std::exit(3);
}

Answer write(Vtop& top, std::uint32_t address, std::uint32_t data) {
    const std::uint64_t start = clocks;
    bool address_taken = false, data_taken = false;
    top.s_axi_awaddr = address;
    top.s_axi_awid = static_cast<SData>(random_state & 0xFFF);
    top.s_axi_wdata = data;
    top.s_axi_awvalid = 1;
    top.s_axi_wvalid = !late();
    for (unsigned n = 0;; ++n) {
        if (n == GIVE_UP) hung("write response");
        top.s_axi_bready = !late();
        top.eval();
        const bool a = top.s_axi_awvalid && top.s_axi_awready, d = top.s_axi_wvalid && top.s_axi_wready;
        const bool b = top.s_axi_bvalid && top.s_axi_bready;
        const std::uint32_t response = top.s_axi_bresp;
        if (top.s_axi_bvalid && top.s_axi_bid != top.s_axi_awid) hung("response of this write");
        edge(top);
        address_taken |= a;
        data_taken |= d;
        top.s_axi_awvalid = !address_taken;
        top.s_axi_wvalid = !data_taken && (top.s_axi_wvalid || !late());
        if (b) return {response, 0, static_cast<std::uint32_t>(clocks - start)};
    }
}

Answer read(Vtop& top, std::uint32_t address) {
    const std::uint64_t start = clocks;
    top.s_axi_araddr = address;
    top.s_axi_arid = static_cast<SData>(random_state & 0xFFF);
    top.s_axi_arvalid = 1;
    for (unsigned n = 0;; ++n) {
        if (n == GIVE_UP) hung("data");
        top.s_axi_rready = !late();
        top.eval();
        const bool a = top.s_axi_arvalid && top.s_axi_arready, r = top.s_axi_rvalid && top.s_axi_rready;
        const Answer answer{top.s_axi_rresp, top.s_axi_rdata, 0};
        if (top.s_axi_rvalid && (top.s_axi_rid != top.s_axi_arid || !top.s_axi_rlast)) hung("data of this read");
        edge(top);
        if (a) top.s_axi_arvalid = 0;
        if (r) return {answer.response, answer.data, static_cast<std::uint32_t>(clocks - start)};
    }
}

Answer carry_out(Vtop& top, const std::uint32_t (&order)[3]) {
    switch (order[0]) {
        case 0: return read(top, order[1]);
        case 1: return write(top, order[1], order[2]);
        case 2:
            for (std::uint32_t n = 0; n < order[2]; ++n) edge(top);
            return {0, 0, order[2]};
        default: {
            const std::uint64_t start = clocks;
            for (;;) {
                const Answer answer = read(top, order[1]);
                const auto taken = static_cast<std::uint32_t>(clocks - start);
                if (answer.response != 0 || (answer.data & order[2]) == 0) return {answer.response, answer.data, taken};
                if (taken > GIVE_UP) hung("end of what it does");
            }
        }
    }
}

bool receive(int fd, void* to, std::size_t count) {
    auto* at = static_cast<char*>(to);
    while (count != 0) {
        const ssize_t got = ::read(fd, at, count);
        if (got <= 0) return false;
        at += got;
        count -= static_cast<std::size_t>(got);
    }
    return true;
}

bool send(int fd, const void* from, std::size_t count) {
    const auto* at = static_cast<const char*>(from);
    while (count != 0) {
        const ssize_t put = ::write(fd, at, count);
        if (put <= 0) return false;
        at += put;
        count -= static_cast<std::size_t>(put);
    }
    return true;
}

}  // namespace

int main(int argc, char** argv) {
    Verilated::commandArgs(argc, argv);
    const char* const number = std::getenv("RTDS_LINK_FD");
    if (number == nullptr) return 2;
    const int fd = std::atoi(number);
    if (const char* const every = std::getenv("RTDS_HPS_STALLS")) stalls = static_cast<unsigned>(std::atoi(every));
#ifdef RTDS_NATIVE
    rtds_fp_modes();
    if (!rtds_fp_works()) {
        std::fprintf(stderr, "this processor's sums and products are not those of the RTL\n");
        return 3;
    }
#endif
    const auto owner = std::make_unique<Vtop>();
    Vtop& top = *owner;
    top.clk_i = 0;
    top.rst_ni = 0;
    top.s_axi_awsize = top.s_axi_arsize = 2;
    top.s_axi_awburst = top.s_axi_arburst = 1;
    top.s_axi_wstrb = 15;
    top.s_axi_wlast = 1;
    top.eval();
    for (int k = 0; k < 4; ++k) edge(top);
    top.rst_ni = 1;
    std::uint32_t count = 0;
    std::vector<Answer> answers;
    while (receive(fd, &count, sizeof count) && count <= 1u << 20) {
        answers.clear();
        std::vector<std::uint32_t> orders(3 * count);
        if (!receive(fd, orders.data(), orders.size() * sizeof(std::uint32_t))) break;
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::uint32_t order[3] = {orders[3 * k], orders[3 * k + 1], orders[3 * k + 2]};
            answers.push_back(carry_out(top, order));
        }
        if (!send(fd, answers.data(), answers.size() * sizeof(Answer))) break;
    }
    top.final();
    return 0;
}
