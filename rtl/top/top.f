// the chip for tools that do not have the vendor's cells
-f chip.f
../vendor/altddio_out.v
