# quartus_sta -t report.tcl: Fmax of each clock and the worst slacks, over all corners.
package require ::quartus::project
package require ::quartus::sta

project_open rtds -revision rtds
create_timing_netlist
read_sdc
foreach_in_collection corner [get_available_operating_conditions] {
    set_operating_conditions $corner
    update_timing_netlist
    puts "corner [get_operating_conditions_info $corner -display_name]"
    foreach row [get_clock_fmax_info] {
        puts [format "  Fmax %-10s %8.2f MHz (restricted %8.2f MHz)" [lindex $row 0] [lindex $row 1] [lindex $row 2]]
    }
    foreach kind {setup hold recovery removal} {
        set worst [lindex [get_timing_paths -$kind -npaths 1] 0]
        if {$worst ne ""} {
            puts [format "  worst %-8s slack %7.3f ns" $kind [get_path_info $worst -slack]]
        }
    }
}
project_close
