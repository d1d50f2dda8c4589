// Main of the Verilator simulators: makes the clocks, and lets cocotb in only when it has something to do.
//
// cocotb's own main looks for callbacks at every time step. Here the clocks are toggled in a plain loop, and VPI
// (hence cocotb) is served
//   - once at the start,
//   - when the top's `sync_o` toggles, after the clock edge has settled,
//   - when a cocotb Timer is due (rounded up to the next clock edge).
// A bridge therefore awaits nothing but changes of sync_o and Timers: other triggers are not looked at in between.
// Values written by cocotb act after the edge at which it was served, that is, before the next one.
//
// Between two visits of cocotb the model's own evaluation is called without the wrapper Vtop::eval(), which locks two
// mutexes each time to look for work (deferred deletion, messages of other threads) that never comes up here: 40 % of
// the time of a small design. With RTDS_POSEDGE even the search for what has changed is left out: between two visits it
// is the clock alone, and what the design does at its rising edge is called directly.
//
// Set by the build, one set a top:
//   RTDS_CLOCKS   comma-separated {&top.<port>, <half period in ps>}, all low at the start
//   RTDS_SYNC     the port that toggles when the bridge is wanted (a one-bit output)
//   RTDS_POSEDGE  set to the clock's port if there is one clock only, nothing depends on its falling edge or level, and
//                 nothing in the design makes an event of its own: then falling edges are not evaluated, the model is
//                 told that the clock was low instead
//   RTDS_IDLE, RTDS_IDLE_COUNT, RTDS_IDLE_LIMIT, RTDS_IDLE_SETTLES
//                 with RTDS_POSEDGE only: while RTDS_IDLE (a port) is 1 nothing looks at RTDS_IDLE_COUNT, which counts up by one a
//                 clock, but for whether it has reached RTDS_IDLE_LIMIT, and from RTDS_IDLE_SETTLES clocks on nothing else
//                 moves. So it is the same whether the count goes on before those clocks or after them: it is set on by all
//                 that can be left out, with the time, and the clocks that settle are the last ones before the limit. There
//                 the whole model is what it is without jumping. The environment's RTDS_EVERY_CLOCK=1 has all clocks
//                 evaluated, with the same result; with =check each of them, once settled, is held against the one before,
//                 byte by byte of the model, and the program ends with status 3 when anything but the count has moved
//   RTDS_PROFILE  with RTDS_POSEDGE only: watches the clocks and writes what the generated members hold in each phase of a
//                 step to the file that the environment's RTDS_PROFILE names (rtds_host.link.pinning reads it)
//   RTDS_PINNED   with RTDS_POSEDGE only: the evaluation of a clock is compiled once more for each phase of a step, with the
//                 values that control has in it, a few successive clocks in one function. See below: "One evaluation a phase".
//                 The environment's RTDS_LOOP=check has the same clocks evaluated the general way, too, and ends the program
//                 with status 3 when a byte of the model differs; =plain evaluates all clocks the general way; =count says
//                 at the end of each request on standard error how many clocks were evaluated which way
//   RTDS_NATIVE   sums and products are the host's own (sim/native)
//   RTDS_WAVES    the model can be traced: what the environment asks for is written to an FST file (class Waves below)
// rtds_phases.h, which rtds_host.link.pinning writes for the last three, says what a phase is.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "Vtop.h"
#include "Vtop___024root.h"
#include "verilated.h"
#include "verilated_vpi.h"

#ifdef RTDS_NATIVE
#include "fp_native.h"
#endif
#ifdef RTDS_WAVES
#include <fstream>

#include "verilated_fst_c.h"
#endif
#if defined(RTDS_PROFILE) || defined(RTDS_PINNED)
#include "rtds_phases.h"
#endif
#ifdef RTDS_PINNED
// The functions of the model once more, to be put into each phase's own.
#include "Vtop__pch.h"
namespace {
namespace pinned {
#if __has_include("Vtop__ConstPool__0__Slow.cpp")
#include "Vtop__ConstPool__0__Slow.cpp"
#endif
#include "Vtop___024root__0.cpp"
}  // namespace pinned
}  // namespace
#endif

extern "C" void vlog_startup_routines_bootstrap(void);

// Defined by the generated code, declared in no header; the weak ones may be missing.
void Vtop___024root___eval(Vtop___024root* root);
__attribute__((weak)) void Vtop___024root___eval_triggers_vec__act(Vtop___024root* root);
__attribute__((weak)) void Vtop___024root___eval_nba(Vtop___024root* root);

namespace {

std::uint64_t now_ps = 0;

struct Clock {
    CData* port;
    std::uint64_t half_ps;
    std::uint64_t next_ps;
};

void settle_value_callbacks() {
    while (VerilatedVpi::callValueCbs()) {
    }
}

// Everything IEEE 1800 wants done in one time step, for a cocotb that may write values and wait again.
void serve_vpi(Vtop& top) {
    settle_value_callbacks();
    do {
        do {
            VerilatedVpi::clearEvalNeeded();
            VerilatedVpi::doInertialPuts();
            top.eval();
            settle_value_callbacks();
        } while (VerilatedVpi::evalNeeded());
        VerilatedVpi::callCbs(cbReadWriteSynch);
        VerilatedVpi::doInertialPuts();
        settle_value_callbacks();
    } while (VerilatedVpi::evalNeeded());
    VerilatedVpi::callCbs(cbReadOnlySynch);
}

// What is due when the time moves on for the first time after serving.
void begin_time_step() {
    VerilatedVpi::callCbs(cbNextSimTime);
    settle_value_callbacks();
    VerilatedVpi::callTimedCbs();
    settle_value_callbacks();
}

#define RTDS_JOIN_(a, b, c) a##b##c
#define RTDS_JOIN(a, b, c) RTDS_JOIN_(a, b, c)
#ifdef RTDS_POSEDGE
#define RTDS_CLOCK_BEFORE RTDS_JOIN(__Vtrigprevexpr___TOP__, RTDS_POSEDGE, __0)
#else
#define RTDS_CLOCK_BEFORE rtds_no_such_member
#endif

// Where the generated code keeps the clock's previous level; null if there is none under the expected name, and then
// falling edges are evaluated like all others.
template <typename Root>
auto clock_before(Root& root, int) -> decltype(&root.RTDS_CLOCK_BEFORE) {
    return &root.RTDS_CLOCK_BEFORE;
}
template <typename Root>
CData* clock_before(Root&, long) {
    return nullptr;
}

#ifndef RTDS_IDLE
#define RTDS_IDLE rtds_no_such_member
#define RTDS_IDLE_COUNT rtds_no_such_member
#define RTDS_IDLE_LIMIT rtds_no_such_member
#define RTDS_IDLE_SETTLES 0
#endif

enum class Idle { jump, evaluate, check };
Idle idle_clocks = Idle::jump;

// The model as it is after an idle clock against the one before, if that followed it at once and it had settled by then. Words
// that hold the count (also a copy of it that the generated code keeps) go on by one.
template <typename Root>
void check_idle(Root& root) {
    static std::vector<unsigned char> before;
    static std::uint64_t count_before = 0, settling = 0;
    const auto* const now = reinterpret_cast<const unsigned char*>(&root);
    const std::uint64_t count = root.RTDS_IDLE_COUNT;
    settling = count == count_before + 1 ? settling + 1 : 0;
    if (settling > RTDS_IDLE_SETTLES) {
        for (std::size_t at = 0; at + 1 < before.size(); at += 2) {
            std::uint16_t was, is;
            std::memcpy(&was, before.data() + at, 2);
            std::memcpy(&is, now + at, 2);
            if (was == is || (was == count_before && is == count)) continue;
            std::fprintf(stderr, "an idle clock moved the model's bytes at %zu: %04x, then %04x\n", at, was, is);
            std::exit(3);
        }
    }
    before.assign(now, now + sizeof root);
    count_before = count;
}

// After the evaluation of a clock: over the idle clocks that follow, but for the last ones before the limit or `due_ps`.
template <typename Root>
auto jump_idle(Root& root, std::uint64_t period_ps, std::uint64_t due_ps, int)
    -> decltype(root.RTDS_IDLE, root.RTDS_IDLE_COUNT, root.RTDS_IDLE_LIMIT, void()) {
    if (!root.RTDS_IDLE) return;
    if (idle_clocks == Idle::check) check_idle(root);
    if (idle_clocks != Idle::jump || now_ps >= due_ps) return;  // the last clock may have passed what is due
    const std::uint64_t left = std::min<std::uint64_t>(root.RTDS_IDLE_LIMIT - root.RTDS_IDLE_COUNT, (due_ps - now_ps) / period_ps);
    if (left <= RTDS_IDLE_SETTLES) return;
    root.RTDS_IDLE_COUNT += left - RTDS_IDLE_SETTLES;
    now_ps += (left - RTDS_IDLE_SETTLES) * period_ps;
}
// The same for a top that has no such clocks.
template <typename Root>
void jump_idle(Root&, std::uint64_t, std::uint64_t, long) {}

#ifdef RTDS_PROFILE
// For each phase and each member: which values it had, and how often. A member of more values than are kept here is none that
// says what a phase does. Written anew after each run of clocks, since the host ends this program without a word.
struct Seen {
    static constexpr int kept = 4;
    std::uint32_t value[kept] = {};
    std::uint64_t times[kept] = {};
    std::uint64_t others = 0;
    void add(std::uint32_t word) {
        for (int k = 0; k < kept; ++k) {
            if (times[k] == 0) value[k] = word;
            if (value[k] == word) {
                ++times[k];
                return;
            }
        }
        ++others;
    }
};
const char* const member_names[] = {
#define RTDS_NAME(name) #name,
    RTDS_MEMBERS(RTDS_NAME)};
constexpr std::size_t member_count = sizeof member_names / sizeof *member_names;
std::vector<std::vector<Seen>> profile(RTDS_PHASE_COUNT);
std::vector<Seen> profile_next(RTDS_PHASE_COUNT);

void profile_clock(const Vtop___024root& root) {
    static unsigned last = RTDS_PHASE_COUNT;
    const unsigned phase = RTDS_PHASE(root);
    if (last < RTDS_PHASE_COUNT) profile_next[last].add(phase);
    last = phase;
    auto& seen = profile[phase];
    seen.resize(member_count);
    std::size_t k = 0;
#define RTDS_ADD(name) seen[k++].add(root.name);
    RTDS_MEMBERS(RTDS_ADD)
}

// Lines "phase N next VALUE", then "MEMBER VALUE TIMES ALL" with the most frequent value.
void write_profile() {
    const char* const path = std::getenv("RTDS_PROFILE");
    if (path == nullptr) return;
    const std::string scratch = std::string(path) + ".new";
    std::FILE* const file = std::fopen(scratch.c_str(), "w");
    if (file == nullptr) return;
    for (std::size_t phase = 0; phase < profile.size(); ++phase) {
        if (profile[phase].empty()) continue;
        const auto most = [](const Seen& seen) {
            return std::max_element(seen.times, seen.times + Seen::kept) - seen.times;
        };
        std::fprintf(file, "phase %zu next %u\n", phase, profile_next[phase].value[most(profile_next[phase])]);
        for (std::size_t k = 0; k < member_count; ++k) {
            const Seen& seen = profile[phase][k];
            std::uint64_t all = seen.others;
            for (const std::uint64_t times : seen.times) all += times;
            std::fprintf(file, "%s %u %llu %llu\n", member_names[k], seen.value[most(seen)],
                         static_cast<unsigned long long>(seen.times[most(seen)]), static_cast<unsigned long long>(all));
        }
    }
    std::fclose(file);
    std::rename(scratch.c_str(), path);
}
#endif

#ifdef RTDS_PINNED
// ---- One evaluation a phase ------------------------------------------------------------------------------------------
// A phase is a clock of a step (RTDS_PHASE gives its number). Control has the same values in it in nearly every step: its pins.
// For each phase there is a copy of the evaluation, compiled for its pins: they are written to the registers once more before
// it, so the compiler knows them and leaves out all that hangs on other values. It is evaluated only in a clock that begins with
// all of these values, so it gives what the general evaluation gives, whatever the pins are.
//
// Successive phases are in one function, a chain. So what one clock stores and the next one overwrites is never stored, and what
// does not change from clock to clock is computed once. Before each clock of a chain its pins are looked at: where control does
// not hang on data the compiler knows that they hold, and nothing is left of it. Otherwise the chain ends early. So it does when
// sync has toggled or idle clocks may follow, which run_clocks sees to. RTDS_STILL are pairs that are equal while no request
// begins: a pin, too, although neither has a value of its own. A clock that begins a chain with other values is evaluated the
// general way, and so are those that follow, up to the next one that begins a chain.
enum class Loop { pinned, plain, check };
Loop loop = Loop::pinned;
bool counting = false;
std::uint64_t clocks_pinned = 0, clocks_general = 0;

template <typename Root>
inline auto is_idle(const Root& root, int) -> decltype(root.RTDS_IDLE, bool()) {
    return root.RTDS_IDLE;
}
template <typename Root>
inline bool is_idle(const Root&, long) {
    return false;
}

#define RTDS_DIFFERS(name, value) differs |= static_cast<unsigned>(root.name) ^ (value);
#define RTDS_UNEQUAL(name, other) differs |= static_cast<unsigned>(root.name) ^ root.other;
#define RTDS_SET(name, value) root.name = (value);
#define RTDS_EQUATE(name, other) root.name = root.other;
#define RTDS_LOOK(phase) \
    unsigned differs = 0; \
    RTDS_PINS_##phase(RTDS_DIFFERS) RTDS_STILL(RTDS_UNEQUAL)
#define RTDS_EVALUATE(phase) \
    RTDS_PINS_##phase(RTDS_SET) RTDS_STILL(RTDS_EQUATE) pinned::Vtop___024root___eval_nba(&root); \
    ++clocks;
#define RTDS_GO_ON(phase)                                                                        \
    {                                                                                            \
        RTDS_LOOK(phase)                                                                         \
        if (differs || root.RTDS_SYNC != sync || is_idle(root, 0)) return {clocks, false};       \
        RTDS_EVALUATE(phase)                                                                     \
    }
#define RTDS_CHAIN_FUNCTIONS(phase, length, next)                          \
    [[gnu::noinline]] bool begins_##phase(const Vtop___024root& root) {    \
        RTDS_LOOK(phase) return differs == 0;                              \
    }                                                                      \
    [[gnu::flatten, gnu::noinline]] Done chain_##phase(Vtop___024root& root) { \
        const CData sync = root.RTDS_SYNC;                                 \
        unsigned clocks = 0;                                               \
        root.__VnbaTriggered[0] = 1;                                       \
        RTDS_EVALUATE(phase)                                               \
        RTDS_CHAIN_##phase(RTDS_GO_ON) RTDS_LOOK(next) return {clocks, differs == 0}; \
    }

struct Done {
    unsigned clocks;
    bool follows;  // the pins of the phase after the chain hold
};
RTDS_CHAINS(RTDS_CHAIN_FUNCTIONS)

struct Chain {
    bool (*begins)(const Vtop___024root&) = nullptr;
    Done (*run)(Vtop___024root&) = nullptr;
    unsigned length = 0;  // clocks, if it does not end early
    unsigned next = 0;    // the phase after it
};
struct Chains {
    Chain at[RTDS_PHASE_COUNT];  // null pointers where none begins
    Chains() {
#define RTDS_ENTRY(phase, length, next) at[phase] = {begins_##phase, chain_##phase, length, next};
        RTDS_CHAINS(RTDS_ENTRY)
    }
};
const Chains chains;

// Clocks by a chain, then as many from the same start the general way: byte by byte the same, or the end.
Done run_checked(const Chain& chain, Vtop___024root& root) {
    auto* const bytes = reinterpret_cast<unsigned char*>(&root);
    static std::vector<unsigned char> start, pinned_end;
    start.assign(bytes, bytes + sizeof root);
    const Done done = chain.run(root);
    pinned_end.assign(bytes, bytes + sizeof root);
    std::memcpy(bytes, start.data(), sizeof root);
    for (unsigned clock = 0; clock < done.clocks; ++clock) Vtop___024root___eval_nba(&root);
    for (std::size_t at = 0; at < sizeof root; ++at) {
        if (bytes[at] == pinned_end[at]) continue;
        std::fprintf(stderr,
                     "the chain of phase %d, %u clocks, differs from the general evaluation in byte %zu of the model: %02x, not %02x\n",
                     static_cast<int>(&chain - chains.at), done.clocks, at, pinned_end[at], bytes[at]);
        std::exit(3);
    }
    return done;
}
#endif

template <typename Root>
void run_clocks(Root& root, const CData& sync, CData sync_before, std::uint64_t period_ps, std::uint64_t due_ps) {
#ifdef RTDS_PINNED
    const Chain* chain = nullptr;  // whose first pins are known to hold
    const bool pinning = loop != Loop::plain && root.__VnbaTriggered[0] == 1;
#endif
    do {
        now_ps += period_ps;
#ifdef RTDS_PINNED
        if (chain == nullptr && pinning) {
            chain = &chains.at[RTDS_PHASE(root)];
            if (chain->begins == nullptr || !chain->begins(root)) chain = nullptr;
        }
        // None that would go beyond what is due.
        if (chain != nullptr && chain->run != nullptr && due_ps - now_ps + period_ps >= chain->length * period_ps) {
            const Done done = loop == Loop::check ? run_checked(*chain, root) : chain->run(root);
            chain = done.follows ? &chains.at[chain->next] : nullptr;
            now_ps += (done.clocks - 1) * period_ps;
            clocks_pinned += done.clocks;
        } else {
            chain = nullptr;
            Vtop___024root___eval_nba(&root);
            ++clocks_general;
        }
#else
#ifdef RTDS_PROFILE
        profile_clock(root);
#endif
        Vtop___024root___eval_nba(&root);
#endif
        jump_idle(root, period_ps, due_ps, 0);
    } while (sync == sync_before && now_ps < due_ps);
#ifdef RTDS_PROFILE
    write_profile();
#endif
#ifdef RTDS_PINNED
    if (counting)
        std::fprintf(stderr, "clocks evaluated by phase %llu, in general %llu\n",
                     static_cast<unsigned long long>(clocks_pinned), static_cast<unsigned long long>(clocks_general));
#endif
}

// Rising edges of the only clock, one a period, until `sync` is no longer what it was or the time reaches `due_ps`.
template <typename Root>
auto run_edges(Root& root, CData& before, const CData& sync, std::uint64_t period_ps, std::uint64_t due_ps, int)
    -> decltype(root.__VactTriggered[0], root.__VnbaTriggered[0], bool()) {
    if (!Vtop___024root___eval_triggers_vec__act || !Vtop___024root___eval_nba) return false;
    const CData sync_before = sync;
    before = 0;
    Vtop___024root___eval_triggers_vec__act(&root);  // which of its events a rising edge is
    root.__VnbaTriggered[0] = root.__VactTriggered[0];
    run_clocks(root, sync, sync_before, period_ps, due_ps);
    root.__VnbaTriggered[0] = 0;
    return true;
}
// The same where the generated code has no such members.
template <typename Root>
bool run_edges(Root&, CData&, const CData&, std::uint64_t, std::uint64_t, long) {
    return false;
}

#ifdef RTDS_WAVES
// Writes chosen signals to an FST file, from one step of the core to another and up to a size. The environment says which:
//   RTDS_WAVES_FILE      the file; without it nothing is written
//   RTDS_WAVES_SIGNALS   a file with a signal a line, full names
//   RTDS_WAVES_FROM, RTDS_WAVES_UNTIL    the first step, and the first one no more
//   RTDS_WAVES_BYTES     the size from which on nothing more is written
//   RTDS_WAVES_CLOCKS    "1": the clock or the count of clocks is among the signals, so no clock may be left out
// The file begins with the host's first request. What became of it goes to standard error, a line "waves: ...".
class Waves {
   public:
    explicit Waves(Vtop& top) : top_(top) {
        const char* const path = std::getenv("RTDS_WAVES_FILE");
        if (path == nullptr) return;
        path_ = path;
        from_ = number("RTDS_WAVES_FROM");
        until_ = number("RTDS_WAVES_UNTIL");
        bytes_ = number("RTDS_WAVES_BYTES");
        const char* const clocks = std::getenv("RTDS_WAVES_CLOCKS");
        every_clock = clocks != nullptr && *clocks == '1';
        fst_.set_time_resolution("10ns");  // half a period of the clock: no edge is between
    }

    bool every_clock = false;

    // Whether the clock that comes is to be written.
    bool look() {
        if (path_.empty() || full_) return false;
        begun_ = begun_ || top_.go_i;
        return begun_ && top_.step_count_o >= from_ && top_.step_count_o < until_;
    }

    void dump() {
        if (!fst_.isOpen() && !open()) return;
        fst_.dump(now_ps / tick_ps);
        if (++dumps_ % dumps_a_look == 0) {
            fst_.flush();
            std::ifstream file(path_, std::ios::binary | std::ios::ate);
            if (static_cast<std::uint64_t>(file.tellg()) >= bytes_) {
                full_ = true;
                std::fprintf(stderr, "waves: full at step %llu\n", static_cast<unsigned long long>(top_.step_count_o));
                fst_.close();
            }
        }
    }

    void close() {
        if (fst_.isOpen()) fst_.close();
        if (dumps_) std::fprintf(stderr, "waves: written\n");
    }

   private:
    static constexpr std::uint64_t tick_ps = 10'000, dumps_a_look = 8192;

    static std::uint64_t number(const char* name) {
        const char* const text = std::getenv(name);
        return text != nullptr ? std::strtoull(text, nullptr, 10) : ~0ull;
    }

    bool open() {
        const char* const names = std::getenv("RTDS_WAVES_SIGNALS");
        std::ifstream list(names != nullptr ? names : "");
        for (std::string name; std::getline(list, name);)
            if (!name.empty()) fst_.dumpvars(1, name);
        top_.trace(&fst_, 99);
        fst_.open(path_.c_str());
        full_ = !fst_.isOpen();
        return !full_;
    }

    Vtop& top_;
    VerilatedFstC fst_;
    std::string path_;
    std::uint64_t from_ = 0, until_ = 0, bytes_ = 0, dumps_ = 0;
    bool begun_ = false, full_ = false;
};
#endif

template <std::size_t N>
void toggle_next(Clock (&clocks)[N]) {
    if (N == 1) {  // the usual case, without the search
        now_ps = clocks[0].next_ps;
        clocks[0].next_ps += clocks[0].half_ps;
        *clocks[0].port = !*clocks[0].port;
        return;
    }
    now_ps = clocks[0].next_ps;
    for (const Clock& clock : clocks) now_ps = std::min(now_ps, clock.next_ps);
    for (Clock& clock : clocks) {
        if (clock.next_ps != now_ps) continue;
        clock.next_ps += clock.half_ps;
        *clock.port = !*clock.port;
    }
}

}  // namespace

double sc_time_stamp() { return static_cast<double>(now_ps); }

int main(int argc, char** argv) {
    Verilated::commandArgs(argc, argv);
    const char* const wanted = std::getenv("RTDS_EVERY_CLOCK");
    if (wanted != nullptr && *wanted == '1') idle_clocks = Idle::evaluate;
    if (wanted != nullptr && *wanted == 'c') idle_clocks = Idle::check;
#ifdef RTDS_PINNED
    const char* const how = std::getenv("RTDS_LOOP");
    if (how != nullptr && std::strcmp(how, "plain") == 0) loop = Loop::plain;
    if (how != nullptr && std::strcmp(how, "check") == 0) loop = Loop::check;
    counting = how != nullptr && std::strcmp(how, "count") == 0;
#endif
#ifdef RTDS_NATIVE
    rtds_fp_modes();
    if (!rtds_fp_works()) {
        std::fprintf(stderr, "this processor's sums and products are not those of the RTL; start it with RTDS_PLAIN=1\n");
        return 3;
    }
#endif
    Verilated::fatalOnVpiError(false);  // cocotb asks for objects that may not exist
#ifdef RTDS_WAVES
    Verilated::traceEverOn(true);
#endif
    const std::unique_ptr<Vtop> owner(new Vtop(""));
    Vtop& top = *owner;
#ifdef RTDS_WAVES
    Waves waves(top);
#endif
    Clock clocks[] = {RTDS_CLOCKS};
    for (Clock& clock : clocks) {
        *clock.port = 0;
        clock.next_ps = clock.half_ps;
    }

    vlog_startup_routines_bootstrap();
    VerilatedVpi::callCbs(cbStartOfSimulation);
    top.eval();
    serve_vpi(top);

    Vtop___024root* const root = top.rootp;
    CData* const before = clock_before(*root, 0);
    CData sync = top.RTDS_SYNC;
    while (!Verilated::gotFinish()) {
        const std::uint64_t due_ps = VerilatedVpi::cbNextDeadline();
#ifdef RTDS_NATIVE
        rtds_fp_modes();  // what Python loads may have changed them
#endif
        toggle_next(clocks);
        begin_time_step();
        top.eval();
#ifdef RTDS_WAVES
        // Both edges of each clock, but for clocks in which nothing moves that is written; outside of what is written the
        // rising edges alone.
        if (waves.look()) waves.dump();
        while (before && top.RTDS_SYNC == sync && now_ps < due_ps) {
            const std::uint64_t period_ps = 2 * clocks[0].half_ps;
            const bool written = waves.look();
            if (*clocks[0].port && !(written && waves.every_clock)) jump_idle(*root, period_ps, due_ps, 0);
            if (written || !*clocks[0].port) {
                clocks[0].next_ps = now_ps + clocks[0].half_ps;
                toggle_next(clocks);
                top.eval();
                if (written) waves.dump();
            } else {
                now_ps += period_ps;
                *before = 0;
                Vtop___024root___eval(root);
            }
        }
        if (before) clocks[0].next_ps = now_ps + clocks[0].half_ps;
#endif
        if (before) {
            if (!*clocks[0].port && top.RTDS_SYNC == sync && now_ps < due_ps) {  // that was a falling edge
                toggle_next(clocks);
                Vtop___024root___eval(root);
            }
            const std::uint64_t period_ps = 2 * clocks[0].half_ps;
            if (top.RTDS_SYNC == sync && now_ps < due_ps &&
                !run_edges(*root, *before, top.RTDS_SYNC, period_ps, due_ps, 0)) {
                while (top.RTDS_SYNC == sync && now_ps < due_ps) {
                    now_ps += period_ps;
                    *before = 0;
                    Vtop___024root___eval(root);
                    jump_idle(*root, period_ps, due_ps, 0);
                }
            }
            if (*clocks[0].port) clocks[0].next_ps = now_ps + clocks[0].half_ps;
        }
        while (top.RTDS_SYNC == sync && now_ps < due_ps) {
            toggle_next(clocks);
            Vtop___024root___eval(root);
        }
        sync = top.RTDS_SYNC;
        VerilatedVpi::callTimedCbs();
        serve_vpi(top);
    }

#ifdef RTDS_WAVES
    waves.close();
#endif
    top.final();
    VerilatedVpi::callCbs(cbEndOfSimulation);
    return Verilated::threadContextp()->errorCount() > 0 ? 1 : 0;
}
