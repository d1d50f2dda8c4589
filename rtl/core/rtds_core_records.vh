// The records at the ports of rtds_core and between its parts: flat vectors, and for each field the place of its lowest bit. The
// order of the fields stands here alone; rtds_host.link.core_records and tb/common/core_records.h read it here.
// For `include inside a module; a module uses a part of it, hence the waiver.
// Format     words of 32 bits, binary32, but where another number of bits is given. SI at the motor shaft. *_BITS is a record's
//            width. A port is declared before a module can include this, so its width is a number there; lint refuses a
//            connection of another width.
// verilator lint_save
// verilator lint_off UNUSEDPARAM

// sides, where something is there once for each
localparam integer LEFT = 0;
localparam integer RIGHT = 1;

// inputs: V, N.m
localparam integer INPUTS_V_L = 0;
localparam integer INPUTS_V_R = 32;
localparam integer INPUTS_T_L = 64;
localparam integer INPUTS_T_R = 96;
localparam integer INPUTS_BITS = INPUTS_T_R + 32;

// motor: ohm, H, N.m/A, V.s/rad, kg.m2, N.m.s/rad
localparam integer MOTOR_R = 0;
localparam integer MOTOR_L = 32;
localparam integer MOTOR_KM = 64;
localparam integer MOTOR_KB = 96;
localparam integer MOTOR_J = 128;
localparam integer MOTOR_B = 160;
localparam integer MOTOR_BITS = MOTOR_B + 32;

// settings of a step: s; switches; delay of the voltages, entries and steps an entry
localparam integer SETTINGS_H = 0;
localparam integer SETTINGS_METHOD = 32;  // 1 bit: 0 backward Euler, 1 trapezoidal
localparam integer SETTINGS_FX_ON = 33;   // 1 bit
localparam integer SETTINGS_FX_OWN = 34;  // 1 bit
localparam integer SETTINGS_DELAY = 35;   // 12 bits
localparam integer SETTINGS_STRIDE = 47;  // 16 bits
localparam integer SETTINGS_BITS = SETTINGS_STRIDE + 16;

// a word for the effect unit
localparam integer WORD_ADDRESS = 0;  // 14 bits
localparam integer WORD_DATA = 14;
localparam integer WORD_BITS = WORD_DATA + 32;

// state, its high or its low words: A, rad/s
localparam integer STATE_I_L = 0;
localparam integer STATE_W_L = 32;
localparam integer STATE_I_R = 64;
localparam integer STATE_W_R = 96;
localparam integer STATE_BITS = STATE_W_R + 32;

// coefficients of a motor's update
localparam integer COEF_R = 0;
localparam integer COEF_KB = 32;
localparam integer COEF_KM = 64;
localparam integer COEF_B = 96;
localparam integer COEF_G11 = 128;
localparam integer COEF_G12 = 160;
localparam integer COEF_G21 = 192;
localparam integer COEF_G22 = 224;
localparam integer COEF_RHO = 256;  // G12 / G22, where effects are on
localparam integer COEF_BITS = COEF_RHO + 32;

// verilator lint_restore
