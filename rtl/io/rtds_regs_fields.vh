// The config group by names: of the vector `cfg` (config_o of rtds_regs) a wire for each word and each bit with a name, and
// one for each row of scalings, the first one lowest.
// Made from python/rtds_host/link/registers.toml by `make registers`; do not edit.
// To be included inside a module after `cfg`; a module uses a part of it, hence the waiver.
// verilator lint_save
// verilator lint_off UNUSEDSIGNAL
// verilator coverage_off

wire [31:0] cfg_r = cfg[0+:32];
wire [31:0] cfg_l = cfg[32+:32];
wire [31:0] cfg_km = cfg[64+:32];
wire [31:0] cfg_kb = cfg[96+:32];
wire [31:0] cfg_j = cfg[128+:32];
wire [31:0] cfg_b = cfg[160+:32];
wire [31:0] cfg_h = cfg[192+:32];
wire cfg_config_method = cfg[224];
wire cfg_config_b_from_adc = cfg[232];
wire cfg_config_j_from_adc = cfg[233];
wire cfg_config_km_from_adc = cfg[234];
wire cfg_config_kb_from_adc = cfg[235];
wire cfg_config_v_from_adc = cfg[236];
wire cfg_config_t_from_adc = cfg[237];
wire [31:0] cfg_v_l = cfg[256+:32];
wire [31:0] cfg_v_r = cfg[288+:32];
wire [31:0] cfg_t_l = cfg[320+:32];
wire [31:0] cfg_t_r = cfg[352+:32];
wire [31:0] cfg_adc_v_l_gain = cfg[384+:32];
wire [31:0] cfg_adc_v_r_gain = cfg[416+:32];
wire [31:0] cfg_adc_t_l_gain = cfg[448+:32];
wire [31:0] cfg_adc_t_r_gain = cfg[480+:32];
wire [31:0] cfg_adc_b_gain = cfg[512+:32];
wire [31:0] cfg_adc_j_gain = cfg[544+:32];
wire [31:0] cfg_adc_km_gain = cfg[576+:32];
wire [31:0] cfg_adc_kb_gain = cfg[608+:32];
wire [31:0] cfg_adc_v_l_offset = cfg[640+:32];
wire [31:0] cfg_adc_v_r_offset = cfg[672+:32];
wire [31:0] cfg_adc_t_l_offset = cfg[704+:32];
wire [31:0] cfg_adc_t_r_offset = cfg[736+:32];
wire [31:0] cfg_adc_b_offset = cfg[768+:32];
wire [31:0] cfg_adc_j_offset = cfg[800+:32];
wire [31:0] cfg_adc_km_offset = cfg[832+:32];
wire [31:0] cfg_adc_kb_offset = cfg[864+:32];
wire [31:0] cfg_dac_i_l_gain = cfg[896+:32];
wire [31:0] cfg_dac_w_l_gain = cfg[928+:32];
wire [31:0] cfg_dac_i_r_gain = cfg[960+:32];
wire [31:0] cfg_dac_w_r_gain = cfg[992+:32];
wire [31:0] cfg_dac_i_l_offset = cfg[1024+:32];
wire [31:0] cfg_dac_w_l_offset = cfg[1056+:32];
wire [31:0] cfg_dac_i_r_offset = cfg[1088+:32];
wire [31:0] cfg_dac_w_r_offset = cfg[1120+:32];
wire [31:0] cfg_r_r = cfg[1152+:32];
wire [31:0] cfg_l_r = cfg[1184+:32];
wire [31:0] cfg_km_r = cfg[1216+:32];
wire [31:0] cfg_kb_r = cfg[1248+:32];
wire [31:0] cfg_j_r = cfg[1280+:32];
wire [31:0] cfg_b_r = cfg[1312+:32];
wire cfg_effects_on = cfg[1344];
wire cfg_effects_own = cfg[1345];
wire [31:0] cfg_delay = cfg[1376+:32];
wire [255:0] cfg_adc_gain = cfg[384+:256];
wire [255:0] cfg_adc_offset = cfg[640+:256];
wire [127:0] cfg_dac_gain = cfg[896+:128];
wire [127:0] cfg_dac_offset = cfg[1024+:128];

// verilator coverage_on
// verilator lint_restore
