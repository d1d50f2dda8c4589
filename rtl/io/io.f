rtl/io/ltc2308_spi_sck.v
rtl/io/ltc2308_spi.v
rtl/io/adc_sequencer.v
rtl/io/adc_scale.v
rtl/io/dac_scale.v
rtl/io/dac_parallel.v
