#!/bin/sh
# Two recorded runs of processes and a table of hashes in the folder given: made when they are missing, else compared.
# A table that was just made is compared as well, in a share that is quick: the same code twice must behave the same.
# Further arguments go to the table: --only straight leases.
set -eu
place=$1
shift
mkdir -p "$place"
test -d "$place/killed" || lfa run paper_path1 --seed 1 --fault 'kill leader at 20 s' --out "$place/killed" --no-figures
test -d "$place/straight" || lfa run straight --seed 1 --out "$place/straight" --no-figures
if test -f "$place/table"; then
    python -m tests.same --runs "$place" --against "$place/table" "$@"
else
    python -m tests.same --runs "$place" --out "$place/table.new" "$@"
    test $# -gt 0 || set -- --only straight killed leases whole
    python -m tests.same --runs "$place" --against "$place/table.new" "$@"
    mv "$place/table.new" "$place/table"
fi
