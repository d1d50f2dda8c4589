ltc2308_spi_sck.v
ltc2308_spi.v
adc_sequencer.v
adc_scale.v
dac_scale.v
dac_parallel.v
