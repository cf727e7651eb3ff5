#!/usr/bin/env bash
# Seconds and MB from nothing to a first answer, outside of the checkout: bash docs/fresh_install.sh
# A wheel is built and installed without pip's cache; beside it the libraries that pyBEMT asks for (requirements.txt without
# its documentation), since pyBEMT itself is on no package index. With its sources in PYBEMT=FOLDER its propeller example runs
# as well (it needs Python 3.11: SafeConfigParser is gone in 3.12). The download is in the time of the install.
set -euo pipefail
root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
unset PYTHONPATH
export PYTHONNOUSERSITE=1 PIP_DISABLE_PIP_VERSION_CHECK=1 BEMT_CACHE="$work/cache"
TIMEFORMAT='%R s, %U s of them CPU'

timed() { # timed WHAT COMMAND...
    printf '%-46s ' "$1"
    { time "${@:2}" >"$work/out" 2>&1; } 2>&1 || { cat "$work/out"; exit 1; }
}

mkdir "$work/tree" "$work/here"
git -C "$root" ls-files -z | tar -C "$root" --null --files-from=- -cf - | tar -C "$work/tree" -xf -
python3 -m venv "$work/ours"
python3 -m venv "$work/peer"
"$work/ours/bin/pip" -q wheel --no-deps --wheel-dir "$work" "$work/tree"
cd -- "$work/here"
timed "install bemt" "$work/ours/bin/pip" -q install --no-cache-dir "$work"/bemt-*.whl
echo "    $(du -sm "$work/ours" | cut -f1) MB"
export PATH="$work/ours/bin:$PATH"
timed "bemt --help, first" bemt --help
timed "bemt --help" bemt --help
timed "bemt new 10x5" bemt new 10x5
timed "bemt sweep: first answer, compiled, tables made" bemt sweep
timed "bemt sweep: again" bemt sweep
timed "bemt drive 10x5 --kv 1000 --cells 3" bemt drive 10x5 --kv 1000 --cells 3
timed "bemt report" bemt report --out report
timed "install pyBEMT's libraries" "$work/peer/bin/pip" -q install --no-cache-dir numpy scipy matplotlib pandas
echo "    $(du -sm "$work/peer" | cut -f1) MB"
timed "import them, first" "$work/peer/bin/python" -c 'import numpy, scipy.optimize, pandas, matplotlib.pyplot'
timed "import them" "$work/peer/bin/python" -c 'import numpy, scipy.optimize, pandas, matplotlib.pyplot'
if [[ -n ${PYBEMT:-} ]]; then
    cd -- "$PYBEMT/examples"
    export MPLBACKEND=Agg PYTHONPATH="$PYBEMT" PYTHONWARNINGS=ignore
    timed "pyBEMT's run_propeller.py, first" "$work/peer/bin/python" run_propeller.py
    timed "pyBEMT's run_propeller.py" "$work/peer/bin/python" run_propeller.py
fi
