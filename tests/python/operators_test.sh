#!/usr/bin/env bash
# The tests of the Python package.   operators_test.sh LIBDOPPEL.so; exit code 77: skipped, python3-torch is missing
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
/usr/bin/python3 -c 'import torch' 2>/dev/null || { echo "python3-torch is not installed; skipped" >&2; exit 77; }
export DOPPEL_LIBRARY="$1" PYTHONPATH="$here/../../python" PYTHONDONTWRITEBYTECODE=1
exec /usr/bin/python3 -m unittest discover -s "$here"
