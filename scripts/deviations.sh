#!/usr/bin/env bash
# Writes docs/results/deviations.md from configs/paper and docs/results/thesis_values.yaml. Build the tests first.
#   scripts/deviations.sh
set -euo pipefail
cd "$(dirname "$0")/.."
DOPPEL_WRITE_DEVIATIONS=1 build/release/tests/tools/tools_test --gtest_brief=1 --gtest_filter=DeviationsPage*
