#!/bin/sh
# reproducible.sh SDIST PYTHON [MOCAP]: two builds of the wheel in folders of other names at other times, and two models
# learnt from the same recordings, have the same bytes.
sdist=$(realpath "$1") python=$2 mocap=$3
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
same() { # WHAT A B
    if cmp -s "$2" "$3"; then echo "$1: the same $(wc -c < "$2") bytes twice, $(sha256sum < "$2" | cut -c 1-16)"
    else echo "$1: not the same bytes twice" >&2; exit 1; fi
}
for build in a another; do
    TMPDIR=$folder/$build && export TMPDIR && mkdir -p "$TMPDIR" &&
        "$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --no-index --no-build-isolation \
            --wheel-dir "$folder/$build" "$sdist" || exit 1
done
same wheel "$folder"/a/*.whl "$folder"/another/*.whl
[ -n "$mocap" ] || { echo 'model: no recordings, skipped'; exit 0; }
for jobs in 1 2; do
    "$python" -m gait learn "$mocap" --jobs $jobs -o "$folder/$jobs.gait" --quiet || exit 1
done
same model "$folder/1.gait" "$folder/2.gait"
