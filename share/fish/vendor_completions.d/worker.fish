complete -c worker -l log-format -d 'The format of the log' -r -f -a "text\t'Lines for people'
json\t'One JSON object per line'"
complete -c worker -l access -d 'The access file that `coordinator serve` wrote, or a copy of it [default: the one in ~/.local/state/pitchline, if there is one only]' -r -F
complete -c worker -l connect -d 'The coordinator\'s address, if it differs from those in the access file; without --access also the choice among several files' -r
complete -c worker -l slots -d 'Number of jobs to compute at once [default: the number of processors]' -r
complete -c worker -l exec -d 'The simulator of a campaign whose [simulator] is "external": a command for `sh -c`' -r
complete -c worker -l exec-timeout -d 'Seconds that the external simulator may take for one answer [default: the campaign\'s, or 600]' -r
complete -c worker -l template -d 'The template of the external simulator\'s input file, with {name} for each variable and {seed} or, with [[random]], {name} for each random input: the command is then run once for each request, in a new folder ($OLDPWD is the folder of this program)' -r -F
complete -c worker -l result -d 'The result file that the external simulator writes: lines of name = value, or a JSON object' -r -F
complete -c worker -l um-bridge -d 'The address of a UM-Bridge server, http://HOST:PORT, whose model is the simulator; repeated for servers that are alike' -r
complete -c worker -l shard -d 'Compute a shard written by `coordinator plan`, without a coordinator; needs --out' -r -F
complete -c worker -l out -d 'The file for the shard\'s results; an existing file of the same shard is continued' -r -F
complete -c worker -l connect-timeout -d 'Seconds to wait for the first answer of the coordinator' -r
complete -c worker -l give-up-after -d 'Seconds without an answer of the coordinator and without a running job after which to leave' -r
complete -c worker -l undelivered -d 'The folder for results that this worker cannot deliver before it ends; the next worker of the campaign delivers them, or `coordinator merge` [default: ~/.local/state/pitchline/undelivered]' -r -F
complete -c worker -l grace -d 'Seconds that running jobs may take to end after SIGTERM' -r
complete -c worker -l max-runtime -d 'Seconds after which to drain and leave, for example before the time on a cluster ends' -r
complete -c worker -l idle-exit -d 'Seconds without any job after which to leave' -r
complete -c worker -s h -l help -d 'Print help (see more with \'--help\')'
complete -c worker -s V -l version -d 'Print version'
