# quartus_sh -t compile.tcl BUILD_ID: the whole flow, with the build identity as a parameter of the top.
package require ::quartus::project
package require ::quartus::flow

project_open rtds -revision rtds
set_parameter -name BUILD_ID "32'h[lindex $quartus(args) 0]"
execute_flow -compile
# The identity stays out of the project's files.
project_close -dont_export_assignments
