// everything behind the pins but the PLL, without the vendor's cells
-f ../fp/fp.f
-f ../core/core.f
-f ../io/io.f
-f ../io/infra.f
../io/rtds_ctrl.v
rtds_port.v
rtds_front.v
rtds_report.v
rtds_chip.v
