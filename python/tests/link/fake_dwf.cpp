// libdwf as far as this project uses it: the vendor's functions under their names, with their checks, on up to three
// Analog Discovery 2. A value counts when it has been applied (auto-configure is on until it is switched off), outputs
// stand between -5 and 5 V, inputs can be read only after a status, a handle only while it is open. fake_* are for tests.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#define API extern "C" __attribute__((visibility("default"))) int

namespace {

constexpr int DEVICES = 3, CHANNELS = 2;
enum { NO_ERROR = 0, UNKNOWN = 1, NOT_SUPPORTED = 4, PARAMETER = 16, NOT_OPEN = 10, LOST = 3 };

struct Device {
    char serial[32];
    bool open, in_use, plugged;
    int auto_configure, on_close;
    int function[CHANNELS], enabled[CHANNELS], running[CHANNELS];
    double offset[CHANNELS], out[CHANNELS], in[CHANNELS], range[CHANNELS], applied_range[CHANNELS];
    int in_enabled[CHANNELS], applied_in[CHANNELS];
    double sampled[CHANNELS];
    bool status;
};

Device devices[DEVICES];
int count = 0, enumerated = -1, error = NO_ERROR, last_index = -1;
char text[512] = "";

int fail(int code, const char* what) {
    error = code;
    std::snprintf(text, sizeof text, "%s\n", what);
    return 0;
}

int fine() {
    error = NO_ERROR;
    text[0] = 0;
    return 1;
}

Device* by_handle(int handle) {
    if (handle < 1 || handle > count || !devices[handle - 1].open) {
        fail(NOT_OPEN, "Invalid device handle provided");
        return nullptr;
    }
    Device* d = &devices[handle - 1];
    if (!d->plugged) {
        fail(LOST, "Device was disconnected");
        return nullptr;
    }
    return d;
}

bool channel_right(int channel) {
    if (channel >= 0 && channel < CHANNELS) return true;
    fail(PARAMETER, "Channel index is out of range");
    return false;
}

void apply_out(Device& d, int c) { d.out[c] = d.enabled[c] && d.running[c] ? d.offset[c] : 0.0; }

void apply_in(Device& d) {
    for (int c = 0; c < CHANNELS; ++c) {
        d.applied_in[c] = d.in_enabled[c];
        d.applied_range[c] = d.range[c];
    }
}

}  // namespace

// --- for tests ---

API fake_reset(int how_many) {
    count = how_many;
    enumerated = -1;
    static const char* serials[DEVICES] = {"SN:210321AAAA01", "SN:210321AAAA02", "SN:210321BBBB02"};
    for (int k = 0; k < DEVICES; ++k) {
        devices[k] = Device{};
        std::strcpy(devices[k].serial, serials[k]);
        devices[k].plugged = true;
        devices[k].auto_configure = 1;
        for (double& range : devices[k].range) range = 50.0;
    }
    return fine();
}
API fake_unplug(int k) { return devices[k].plugged = false, 1; }
API fake_use(int k) { return devices[k].in_use = true, 1; }
API fake_is_open(int k) { return devices[k].open; }
API fake_on_close(int k) { return devices[k].on_close; }
extern "C" double fake_output(int k, int c) { return devices[k].out[c]; }
extern "C" void fake_input(int k, int c, double volts) { devices[k].in[c] = volts; }

// --- the vendor's functions ---

API FDwfGetLastError(int* code) { return *code = error, 1; }
API FDwfGetLastErrorMsg(char* to) { return std::strcpy(to, text), 1; }
API FDwfGetVersion(char* to) { return std::strcpy(to, "3.20.1"), 1; }

API FDwfEnum(int filter, int* to) {
    if (filter < 0) return fail(PARAMETER, "Unknown filter");
    *to = enumerated = count;
    return fine();
}
API FDwfEnumSN(int index, char* to) {
    if (enumerated < 0 || index < 0 || index >= enumerated) return fail(PARAMETER, "Device index is out of range");
    std::strcpy(to, devices[index].serial);
    return fine();
}
API FDwfEnumDeviceIsOpened(int index, int* to) {
    if (enumerated < 0 || index < 0 || index >= enumerated) return fail(PARAMETER, "Device index is out of range");
    *to = devices[index].in_use || devices[index].open;
    return fine();
}
API FDwfDeviceOpen(int index, int* to) {
    if (enumerated < 0 || index < 0 || index >= enumerated) return fail(PARAMETER, "Device index is out of range");
    if (devices[index].in_use || devices[index].open) return fail(UNKNOWN, "Device is in use");
    if (!devices[index].plugged) return fail(LOST, "Device was disconnected");
    devices[index].open = true;
    *to = index + 1;
    return fine();
}
API FDwfDeviceClose(int handle) {
    if (handle < 1 || handle > count || !devices[handle - 1].open) return fail(NOT_OPEN, "Invalid device handle provided");
    Device& d = devices[handle - 1];
    d.open = false;
    if (d.on_close)
        for (int c = 0; c < CHANNELS; ++c) d.out[c] = 0.0;
    return fine();
}
API FDwfDeviceAutoConfigureSet(int handle, int on) {
    Device* d = by_handle(handle);
    if (!d) return 0;
    if (on < 0 || on > 3) return fail(PARAMETER, "Invalid auto configure mode");
    d->auto_configure = on;
    return fine();
}
API FDwfDeviceParamSet(int handle, int parameter, int value) {
    Device* d = by_handle(handle);
    if (!d) return 0;
    if (parameter != 4) return fail(NOT_SUPPORTED, "Parameter is not supported");
    if (value < 0 || value > 2) return fail(PARAMETER, "Invalid value");
    d->on_close = value;
    return fine();
}

API FDwfAnalogOutNodeFunctionSet(int handle, int channel, int node, unsigned char function) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    if (node != 0) return fail(NOT_SUPPORTED, "Node is not supported");
    if (function > 9 && function < 30) return fail(PARAMETER, "Function is not supported");
    d->function[channel] = function;
    return fine();
}
API FDwfAnalogOutNodeEnableSet(int handle, int channel, int node, int mode) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    if (node != 0) return fail(NOT_SUPPORTED, "Node is not supported");
    d->enabled[channel] = mode;
    if (d->auto_configure) apply_out(*d, channel);
    return fine();
}
API FDwfAnalogOutNodeOffsetSet(int handle, int channel, int node, double volts) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    if (node != 0) return fail(NOT_SUPPORTED, "Node is not supported");
    if (std::isnan(volts)) return fail(PARAMETER, "Offset is no number");
    d->offset[channel] = std::clamp(volts, -5.0, 5.0);
    if (d->auto_configure) apply_out(*d, channel);
    return fine();
}
API FDwfAnalogOutConfigure(int handle, int channel, int start) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    if (start < 0 || start > 3) return fail(PARAMETER, "Invalid start mode");
    if (d->function[channel] != 0) return fail(PARAMETER, "Not a constant voltage: this fake knows no other function");
    if (start == 3 && !d->running[channel]) return fail(PARAMETER, "Generator is not running");
    if (start < 2) d->running[channel] = start;
    apply_out(*d, channel);
    return fine();
}

API FDwfAnalogInChannelEnableSet(int handle, int channel, int on) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    d->in_enabled[channel] = on;
    if (d->auto_configure) apply_in(*d);
    return fine();
}
API FDwfAnalogInChannelRangeSet(int handle, int channel, double range) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    if (!(range > 0)) return fail(PARAMETER, "Invalid range");
    d->range[channel] = range <= 5.0 ? 5.0 : 50.0;
    if (d->auto_configure) apply_in(*d);
    return fine();
}
API FDwfAnalogInConfigure(int handle, int reconfigure, int start) {
    Device* d = by_handle(handle);
    if (!d) return 0;
    if ((reconfigure | start) & ~1) return fail(PARAMETER, "Invalid flag");
    if (reconfigure) apply_in(*d);
    d->status = false;
    return fine();
}
API FDwfAnalogInStatus(int handle, int, unsigned char* state) {
    Device* d = by_handle(handle);
    if (!d) return 0;
    for (int c = 0; c < CHANNELS; ++c) {
        const double half = d->applied_range[c] / 2, step = d->applied_range[c] / 16384;
        d->sampled[c] = d->applied_in[c] ? std::nearbyint(std::clamp(d->in[c], -half, half) / step) * step : 0.0;
    }
    d->status = true;
    *state = 0;
    return fine();
}
API FDwfAnalogInStatusSample(int handle, int channel, double* to) {
    Device* d = by_handle(handle);
    if (!d || !channel_right(channel)) return 0;
    if (!d->status) return fail(PARAMETER, "No status has been read");
    *to = d->sampled[channel];
    return fine();
}
