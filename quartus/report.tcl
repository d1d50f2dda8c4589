# quartus_sta -t report.tcl PROJECT: Fmax of each clock and the worst slacks, over all corners. Status 1 when a slack is negative.
package require ::quartus::project
package require ::quartus::sta

set project [lindex $quartus(args) 0]
project_open $project -revision $project
create_timing_netlist
read_sdc
set missed 0
foreach_in_collection corner [get_available_operating_conditions] {
    set_operating_conditions $corner
    update_timing_netlist
    puts "corner [get_operating_conditions_info $corner -display_name]"
    foreach row [get_clock_fmax_info] {
        puts [format "  Fmax %-10s %8.2f MHz (restricted %8.2f MHz)" [lindex $row 0] [lindex $row 1] [lindex $row 2]]
    }
    foreach kind {setup hold recovery removal} {
        foreach_in_collection path [get_timing_paths -$kind -npaths 1] {
            set slack [get_path_info $path -slack]
            puts [format "  worst %-8s slack %7.3f ns" $kind $slack]
            if {$slack < 0} {
                set missed 1
            }
        }
    }
}
project_close
if {$missed} {
    puts stderr "timing is not met: a slack is negative"
    exit 1
}
