# quartus_sh -t compile.tcl BUILD_ID PROJECT: the whole flow, with the build identity as a parameter of the top.
#
# BUILD_ID is hexadecimal. Its first seven digits are set as a decimal number: Quartus takes a parameter's value for a number
# when it reads as one, and a Verilog literal or digits like 1234e567 may be taken for a string or for another number. Seven
# digits are below 2^31, where signed and unsigned agree.
package require ::quartus::project
package require ::quartus::flow

scan [string range [lindex $quartus(args) 0] 0 6] %x build_id

set project [lindex $quartus(args) 1]

project_open $project -revision $project
set_parameter -name BUILD_ID $build_id
set failed [catch {execute_flow -compile} message]
# The flow exports the assignments; the identity is taken out of the project's files again.
set_parameter -name BUILD_ID -remove
export_assignments
project_close
if {$failed} {
    error $message
}
