# Print an optspec for argparse to handle cmd's options that are independent of any subcommand.
function __fish_coordinator_global_optspecs
    string join \n log-format= fail-point= h/help V/version
end

function __fish_coordinator_needs_command
    # Figure out if the current invocation already has a command.
    set -l cmd (commandline -opc)
    set -e cmd[1]
    argparse -s (__fish_coordinator_global_optspecs) -- $cmd 2>/dev/null
    or return
    if set -q argv[1]
        # Also print the command, so this can be used to figure out what it is.
        echo $argv[1]
        return 1
    end
    return 0
end

function __fish_coordinator_using_subcommand
    set -l cmd (__fish_coordinator_needs_command)
    test -z "$cmd"
    and return 1
    contains -- $cmd[1] $argv
end

complete -c coordinator -n "__fish_coordinator_needs_command" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_needs_command" -l fail-point -d 'The fail point at which a test ends the program, see the documentation of the crate `store`' -r
complete -c coordinator -n "__fish_coordinator_needs_command" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_needs_command" -s V -l version -d 'Print version'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "run" -d 'Run a whole campaign on this machine'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "serve" -d 'Run a campaign with workers that connect over the network'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "plan" -d 'Write the missing jobs as shard files, for nodes that cannot connect to a coordinator'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "merge" -d 'Store the result files (parts) that workers made of shards'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "status" -d 'Print the progress of a campaign, during or after the run'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "view" -d 'Serve the live page of a campaign from its store alone, during or after the run'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "explain" -d 'Print why no job, or no further job, is being computed'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "drain" -d 'Stop leasing jobs; the coordinator ends once the leased jobs are reported'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "retry" -d 'Try the quarantined jobs again'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "discard" -d 'Remove stored results of a design or of a worker, to be computed again'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "sweep" -d 'Run a campaign for each of several numbers of teeth, and compare'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "sizing" -d 'Design with other teeth, modules, face widths, helix angles and racks, and rank them'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "sensitivity" -d 'Measure how tolerances, the wear\'s parameters and the torque affect the recommended design'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "pareto" -d 'Show the trade-off between the percentile and the contact pressure or the root stress'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "tradeoff" -d 'Chart speed against accuracy: simulator, percentile, kriging, optimisation, runner'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "simulate-cluster" -d 'Simulate a cluster, to show how many workers one coordinator can serve'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "sleep-program" -d 'Answer as a simulator that sleeps, for `tradeoff`'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "report" -d 'Write the report of a campaign, during or after the run'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "export" -d 'Write a table of a campaign as CSV or JSON, its model, or an optimum as a pair file'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "fit" -d 'Fit a kriging model to a table of your own, and validate it'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "predict" -d 'Predict at points with a fitted model'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "compare" -d 'Print a campaign\'s figures next to the paper\'s, as Markdown'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "simulate" -d 'Simulate one gear pair'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "import" -d 'Convert a gear stage in REXS to a pair file for `simulate`'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "um-bridge" -d 'Offer a campaign\'s gear model to other programs, as a UM-Bridge model'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "stability" -d 'Run inputs on which numerical methods fail, and write how each failure is detected and handled'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "check" -d 'Validate a campaign file and say what it would do'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "init" -d 'Write a commented campaign file to start from'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "completions" -d 'Print what a shell needs to complete commands and options of both programs'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "share" -d 'Write man pages, completions of all shells and schemas into a folder, for packages'
complete -c coordinator -n "__fish_coordinator_needs_command" -f -a "help" -d 'Print this message or the help of the given subcommand(s)'
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l db -d 'The store; a campaign that it holds is continued [default: NAME.db]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l workers -d 'Number of workers to start in this process [default: the processors divided by simulator.processors]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l exec -d 'The simulator of a campaign whose [simulator] is "external": a command for `sh -c`' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l exec-timeout -d 'Seconds that the external simulator may take for one answer [default: the campaign\'s, or 600]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l template -d 'The template of the external simulator\'s input file, with {name} for each variable and {seed} or, with [[random]], {name} for each random input: the command is then run once for each request, in a new folder ($OLDPWD is the folder of this program)' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l result -d 'The result file that the external simulator writes: lines of name = value, or a JSON object' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l um-bridge -d 'The address of a UM-Bridge server, http://HOST:PORT, whose model is the simulator; repeated for servers that are alike' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l out -d 'The folder of the report [default: NAME-report]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l http -d 'Serve a live page at http://ADDR, with its data at /api/v1/status and the like, and metrics for Prometheus at /metrics; loopback only' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l allow-network-store -d 'Accept a store on a network file system, whose locks and syncs may be unreliable'
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l until-input-ends -d 'Stop as at Ctrl-C once standard input ends: for a program that starts this one and may be killed'
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -l retry-failed -d 'Compute again what failed in every attempt: samples that count as failed, designs, and candidates of searches'
complete -c coordinator -n "__fish_coordinator_using_subcommand run" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l db -d 'The store; a campaign that it holds is continued' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l listen -d 'The address to listen on, such as 127.0.0.1:7400 [default: all interfaces, at the port of the last run if it is free, else at any free port]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l access -d 'The access file to write, for workers and commands [default: NAME.access in ~/.local/state/pitchline]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l host -d 'A further name or address of this machine for the access file; may be repeated' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l workers -d 'Number of workers to start in this process' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l exec -d 'The simulator of a campaign whose [simulator] is "external": a command for `sh -c`' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l exec-timeout -d 'Seconds that the external simulator may take for one answer [default: the campaign\'s, or 600]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l template -d 'The template of the external simulator\'s input file, with {name} for each variable and {seed} or, with [[random]], {name} for each random input: the command is then run once for each request, in a new folder ($OLDPWD is the folder of this program)' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l result -d 'The result file that the external simulator writes: lines of name = value, or a JSON object' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l um-bridge -d 'The address of a UM-Bridge server, http://HOST:PORT, whose model is the simulator; repeated for servers that are alike' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l out -d 'The folder of the report [default: NAME-report]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l http -d 'Serve a live page at http://ADDR, with its data at /api/v1/status and the like, and metrics for Prometheus at /metrics; loopback only' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l lease -d 'Seconds without a heartbeat after which a worker\'s leases expire and others get the jobs; results that arrive later are still stored' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l allow-network-store -d 'Accept a store on a network file system, whose locks and syncs may be unreliable'
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l retry-failed -d 'Compute again what failed in every attempt: samples that count as failed, designs, and candidates of searches'
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -l keep-serving -d 'Keep serving when the campaign is finished, until a signal or `drain`'
complete -c coordinator -n "__fish_coordinator_using_subcommand serve" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l db -d 'The store; a campaign that it holds is continued' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l shards -d 'Number of shards to divide the jobs among' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l out -d 'The folder of the shards; one that is not empty is refused' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l report -d 'The folder of the report, which is written if no job is missing [default: NAME-report]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l allow-network-store -d 'Accept a store on a network file system, whose locks and syncs may be unreliable'
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand plan" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand merge" -l db -d 'The store that planned the shards' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand merge" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand merge" -l allow-network-store -d 'Accept a store on a network file system, whose locks and syncs may be unreliable'
complete -c coordinator -n "__fish_coordinator_using_subcommand merge" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand merge" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l db -d 'Read the store instead of asking the running coordinator; workers and rates are then not shown' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l access -d 'The access file that `coordinator serve` wrote, or a copy of it [default: the one in ~/.local/state/pitchline, if there is one only]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l connect -d 'The coordinator\'s address, if it differs from those in the access file; without --access also the choice among several files' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l check -d 'Check everything in the store against its digests first, which takes seconds for millions of samples'
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -l watch -d 'Print again whenever something has changed, until the campaign is finished'
complete -c coordinator -n "__fish_coordinator_using_subcommand status" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand view" -l db -d 'The store, which is only read' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand view" -l http -d 'The address of the page; loopback only [default: 127.0.0.1 at a free port]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand view" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand view" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand explain" -l access -d 'The access file that `coordinator serve` wrote, or a copy of it [default: the one in ~/.local/state/pitchline, if there is one only]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand explain" -l connect -d 'The coordinator\'s address, if it differs from those in the access file; without --access also the choice among several files' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand explain" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand explain" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand explain" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand drain" -l access -d 'The access file that `coordinator serve` wrote, or a copy of it [default: the one in ~/.local/state/pitchline, if there is one only]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand drain" -l connect -d 'The coordinator\'s address, if it differs from those in the access file; without --access also the choice among several files' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand drain" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand drain" -l resume -d 'Lease jobs again after an earlier `drain`'
complete -c coordinator -n "__fish_coordinator_using_subcommand drain" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand retry" -l access -d 'The access file that `coordinator serve` wrote, or a copy of it [default: the one in ~/.local/state/pitchline, if there is one only]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand retry" -l connect -d 'The coordinator\'s address, if it differs from those in the access file; without --access also the choice among several files' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand retry" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand retry" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l db -d 'The store, which no coordinator may have open' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l design -d 'Samples, criteria and recorded failures of the design with this number' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l worker -d 'Everything that came from this worker, or from all workers of this host' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l yes -d 'Remove them; without it they are only counted'
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l allow-network-store -d 'Accept a store on a network file system, whose locks and syncs may be unreliable'
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand discard" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l teeth -d 'Numbers of teeth of the pinion: 17..30 is 17 to 29, 17..=30 is 17 to 30' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l out -d 'The folder of the stores, reports and tables; a sweep that it holds is continued [default: NAME-sweep]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l workers -d 'Number of workers to start in this process [default: the processors divided by simulator.processors]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l exec -d 'The simulator of a campaign whose [simulator] is "external": a command for `sh -c`' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l exec-timeout -d 'Seconds that the external simulator may take for one answer [default: the campaign\'s, or 600]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l template -d 'The template of the external simulator\'s input file, with {name} for each variable and {seed} or, with [[random]], {name} for each random input: the command is then run once for each request, in a new folder ($OLDPWD is the folder of this program)' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l result -d 'The result file that the external simulator writes: lines of name = value, or a JSON object' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l um-bridge -d 'The address of a UM-Bridge server, http://HOST:PORT, whose model is the simulator; repeated for servers that are alike' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l allow-network-store -d 'Accept stores on a network file system, whose locks and syncs may be unreliable'
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -l json -d 'Print the tables as one JSON object instead of the page'
complete -c coordinator -n "__fish_coordinator_using_subcommand sweep" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l teeth -d 'Numbers of teeth of the pinion: 17..30 is 17 to 29, 17..=30 is 17 to 30' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l ratio-tolerance -d 'Largest deviation of the gear ratio from the campaign\'s, as a share of it' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l modules -d 'Normal modules in mm, such as 2.5,2.75,3 [default: the campaign\'s]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l face-widths -d 'Face widths in mm, such as 25,30 [default: the campaign\'s]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l helix-angles -d 'Helix angles in degrees, such as 12,15,18, each of which is then fixed [default: the campaign\'s]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l racks -d 'Standard racks that cut both gears, such as iso-53-a,iso-53-c [default: the campaign\'s tools]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l top -d 'Number of sizes that get verification samples and a pair file' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l out -d 'The folder of the tables and pair files; one that is not empty is refused [default: NAME-sizing]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -l json -d 'Print the tables as one JSON object instead of the page'
complete -c coordinator -n "__fish_coordinator_using_subcommand sizing" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l db -d 'The finished store of the campaign [default: NAME.db]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l approach -d 'The approach whose optimum is analysed [default: the one with the least verified percentile]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l tolerance -d 'Largest deviation of profile shifts and tool heights, in modules' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l radius-tolerance -d 'Largest deviation of free tip and root radii, in mm' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l helix-angle-tolerance -d 'Largest deviation of a free helix angle, in degrees' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l tip-relief-tolerance -d 'Largest deviation of free amounts of tip relief, in µm' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l relief-length-tolerance -d 'Largest deviation of free lengths of tip relief, in mm along the path of contact' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l crowning-tolerance -d 'Largest deviation of a free crowning, in µm' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l helix-slope-tolerance -d 'Largest deviation of a free helix slope, in µm' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l scenario -d 'Largest deviation of the wear\'s depth, variance and range, and of the tolerances of `[manufacture]`, as a share of each' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l torque -d 'Largest deviation of all torques together, as a share of them' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l rows -d 'Rows of each analysis, preferably a power of two; a row simulates two pairs more than there are inputs' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l out -d 'The folder of the tables; one that is not empty is refused [default: NAME-sensitivity]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -l json -d 'Print the tables as one JSON object instead of the page'
complete -c coordinator -n "__fish_coordinator_using_subcommand sensitivity" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -l db -d 'The finished store of the campaign [default: NAME.db]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -l against -d 'The second objective, against the percentile' -r -f -a "pressure\t'p_H, the largest contact pressure with Archard\'s wear'
root-stress\t'σ_vm, the larger root stress'"
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -l refine -d 'Number of direct searches, each of optimise.evaluations designs, to add to the front' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -l out -d 'The folder of the table and the chart; one that is not empty is refused [default: NAME-pareto]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -l json -d 'Print the tables as one JSON object instead of the page'
complete -c coordinator -n "__fish_coordinator_using_subcommand pareto" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -l out -d 'The folder of tables, charts and page; studies in it of the same campaign, size and program are not measured again [default: NAME-tradeoff]' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -l study -d 'Measure only these studies: simulator, contact, percentile, estimators, kriging, optimisation, runner, cores, growth' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -l designs -d 'Number of designs to measure, for tests of the command' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -l quick -d 'Measure for one to three minutes instead of ten'
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -l json -d 'Print the tables as one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand tradeoff" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l workers -d 'Numbers of workers' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l sample-seconds -d 'Seconds that a sample takes' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l slots -d 'Jobs that a worker computes at once' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l seconds -d 'Simulated seconds [default: 20, or the time of five samples]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l failure-hours -d 'Mean hours until a worker fails [default: never]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l wave-share -d 'Share of the workers that each wave of preemption takes [default: no waves]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l wave-every -d 'Seconds between two waves' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l wave-away -d 'Seconds until preempted workers are back' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l seed -d 'Seed of the simulated times and failures' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l out -d 'The folder for cluster.csv and cluster.svg' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -l json -d 'Print one JSON object for each scenario, as a list'
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate-cluster" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand sleep-program" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand sleep-program" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand report" -l db -d 'The store' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand report" -l out -d 'The folder of the report' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand report" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand report" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l db -d 'The store' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l table -d 'The table to export' -r -f -a "designs\t'The DoE: whether each design is simulable and feasible, its criteria, and why one has no samples'
samples\t'Every sample'
responses\t'The measure of every sampled design'
loo\t'The kriging model\'s leave-one-out predictions'
optima\t'The optimum of each approach'
rounds\t'What every round of infill decided'
infill\t'The infill points, with the measure of the samples that each brought'
evaluations\t'The answer of an external simulator for each candidate of the optimiser\'s runs'
failures\t'Crashes, failures and quarantined jobs, with their errors, in the order in which they occurred'
blocks\t'Which worker process computed which samples, of designs, optima and infill points'
model\t'The kriging model with its inputs and their bounds, as `fit --out` writes one: one JSON object'"
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l pair -d 'Write an optimum as a pair file for `simulate`; one that exists is refused' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l format -d 'The form of the table; the model is always JSON' -r -f -a "csv\t'One header line, units in the names'
json\t'One JSON object, with `schema_version` and the rows as objects'
parquet\t'A Parquet file, units in its metadata'"
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l out -d 'The table\'s file, or - for standard output; one that exists is refused' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l approach -d 'The approach whose optimum --pair writes [default: the recommended one]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -l infeasible -d 'Write the design that violates the constraints least, where the approach found no feasible one'
complete -c coordinator -n "__fish_coordinator_using_subcommand export" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l response -d 'The column of the observations' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l variance -d 'The column of the observations\' noise variances, in the response\'s unit squared' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l inputs -d 'The columns of the inputs [default: all other columns whose numbers differ]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l kernel -d 'matern-5-2, matern-3-2, squared-exponential, exponential, or radial-matern-5-2, radial-matern-3-2, radial-exponential' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l method -d 'auto, exact (all observations) or vecchia (the nearest ones); auto is exact up to 10 000' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l estimator -d 'likelihood or posterior-mode (a prior on the ranges, for few points)' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l trend -d 'constant or linear' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l nugget -d 'known (no noise but --variance) or estimated [default: known with --variance, else estimated]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l response-scale -d 'plain, or log to model the logarithm of a positive response' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l seed -d 'The seed of the search\'s random starts' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l out -d 'The model file to write; one that exists is refused' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l skip-missing -d 'Leave out rows in which a column of the model is empty, NA, NaN or the like, and say which'
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l calibrate -d 'Scale the predicted variances to the leave-one-out residuals'
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand fit" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l model -d 'The model file of `fit --out` or `export --table model`' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l db -d 'The store of a campaign, whose model of the percentile is taken' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l at -d 'The points: a table with a column for each input, in any order' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l level -d 'The probability of the quantile of the predicted distribution' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l interval -d 'The probability of the intervals of the mean and of a new observation' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l out -d 'The file, or - for standard output; one that exists is refused' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l skip-missing -d 'Leave out rows in which an input is empty, NA, NaN or the like, and say which'
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -l json -d 'Write one JSON object instead of CSV'
complete -c coordinator -n "__fish_coordinator_using_subcommand predict" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand compare" -l db -d 'The store' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand compare" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand compare" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand compare" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l pair -d 'The pair file' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l wear -d 'The wear of the tooth flanks' -r -f -a "none\t'New flanks'
archard\t'Archard\'s wear, the mean of the random one'
random\t'Archard\'s wear times random fields, on flanks of the file\'s class, many samples'"
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l seed -d 'The seed of random wear; only with --wear random [default: 1]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l samples -d 'Number of samples of random wear, at least 4; only with --wear random [default: 30]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l out -d 'Write an HTML page with charts (SVG) and their points (CSV), the data sheet, and files for other programs (DXF, REXS) into this folder, new or empty' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand simulate" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand import" -l torque -d 'Torque on the pinion in N·m [default: that of the first load case]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand import" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand import" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand um-bridge" -l http -d 'The address of the server; loopback only [default: 127.0.0.1:4242]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand um-bridge" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand um-bridge" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand stability" -l out -d 'The folder of the page and its tables; one that is not empty is refused' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand stability" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand stability" -l json -d 'Print one JSON object instead of a line for each entry'
complete -c coordinator -n "__fish_coordinator_using_subcommand stability" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l exec -d 'The simulator of a campaign whose [simulator] is "external": a command for `sh -c`' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l exec-timeout -d 'Seconds that the external simulator may take for one answer [default: the campaign\'s, or 600]' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l template -d 'The template of the external simulator\'s input file, with {name} for each variable and {seed} or, with [[random]], {name} for each random input: the command is then run once for each request, in a new folder ($OLDPWD is the folder of this program)' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l result -d 'The result file that the external simulator writes: lines of name = value, or a JSON object' -r -F
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l um-bridge -d 'The address of a UM-Bridge server, http://HOST:PORT, whose model is the simulator; repeated for servers that are alike' -r
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -l json -d 'Print one JSON object'
complete -c coordinator -n "__fish_coordinator_using_subcommand check" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand init" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand init" -l external -d 'Write a problem without gears, and a program in Python that simulates it'
complete -c coordinator -n "__fish_coordinator_using_subcommand init" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand completions" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand completions" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand share" -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c coordinator -n "__fish_coordinator_using_subcommand share" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "run" -d 'Run a whole campaign on this machine'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "serve" -d 'Run a campaign with workers that connect over the network'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "plan" -d 'Write the missing jobs as shard files, for nodes that cannot connect to a coordinator'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "merge" -d 'Store the result files (parts) that workers made of shards'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "status" -d 'Print the progress of a campaign, during or after the run'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "view" -d 'Serve the live page of a campaign from its store alone, during or after the run'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "explain" -d 'Print why no job, or no further job, is being computed'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "drain" -d 'Stop leasing jobs; the coordinator ends once the leased jobs are reported'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "retry" -d 'Try the quarantined jobs again'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "discard" -d 'Remove stored results of a design or of a worker, to be computed again'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "sweep" -d 'Run a campaign for each of several numbers of teeth, and compare'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "sizing" -d 'Design with other teeth, modules, face widths, helix angles and racks, and rank them'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "sensitivity" -d 'Measure how tolerances, the wear\'s parameters and the torque affect the recommended design'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "pareto" -d 'Show the trade-off between the percentile and the contact pressure or the root stress'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "tradeoff" -d 'Chart speed against accuracy: simulator, percentile, kriging, optimisation, runner'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "simulate-cluster" -d 'Simulate a cluster, to show how many workers one coordinator can serve'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "sleep-program" -d 'Answer as a simulator that sleeps, for `tradeoff`'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "report" -d 'Write the report of a campaign, during or after the run'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "export" -d 'Write a table of a campaign as CSV or JSON, its model, or an optimum as a pair file'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "fit" -d 'Fit a kriging model to a table of your own, and validate it'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "predict" -d 'Predict at points with a fitted model'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "compare" -d 'Print a campaign\'s figures next to the paper\'s, as Markdown'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "simulate" -d 'Simulate one gear pair'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "import" -d 'Convert a gear stage in REXS to a pair file for `simulate`'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "um-bridge" -d 'Offer a campaign\'s gear model to other programs, as a UM-Bridge model'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "stability" -d 'Run inputs on which numerical methods fail, and write how each failure is detected and handled'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "check" -d 'Validate a campaign file and say what it would do'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "init" -d 'Write a commented campaign file to start from'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "completions" -d 'Print what a shell needs to complete commands and options of both programs'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "share" -d 'Write man pages, completions of all shells and schemas into a folder, for packages'
complete -c coordinator -n "__fish_coordinator_using_subcommand help; and not __fish_seen_subcommand_from run serve plan merge status view explain drain retry discard sweep sizing sensitivity pareto tradeoff simulate-cluster sleep-program report export fit predict compare simulate import um-bridge stability check init completions share help" -f -a "help" -d 'Print this message or the help of the given subcommand(s)'
