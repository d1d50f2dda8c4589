// For the mains of benches without cocotb: leaves the counts of lines and toggles where RTL_COVERAGE says, if the bench was
// built with them (`make coverage`).
#pragma once

#include <cstdlib>
#include <string>

#include <unistd.h>

#include "verilated.h"
#if VM_COVERAGE
#include "verilated_cov.h"
#endif

inline void write_coverage(const char* bench) {
#if VM_COVERAGE
    if (const char* folder = std::getenv("RTL_COVERAGE"))
        VerilatedCov::write(std::string(folder) + "/" + bench + "-" + std::to_string(getpid()) + ".dat");
#else
    static_cast<void>(bench);
#endif
}
