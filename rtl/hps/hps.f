// the motors behind the bridge of the board's own processor, without the vendor's cells
-f ../fp/fp.f
-f ../core/core.f
axi_slave.v
hps_run.v
rtds_hps.v
