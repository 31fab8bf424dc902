# shellcheck shell=bash
# Sourced by the tests of scripts.

failed=0

# The exit code of a command, and words in what it says.
expect() { # CODE WORDS COMMAND...
  local code=$1 words=$2 found=0 output
  shift 2
  output=$("$@" 2>&1) || found=$?
  if [[ $found != "$code" || $output != *"$words"* ]]; then
    printf 'FAILED: %s\n  expected exit code %s and "%s", found %s and:\n%s\n' \
      "$*" "$code" "$words" "$found" "$output"
    failed=1
  fi
}
