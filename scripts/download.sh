# shellcheck shell=bash
# Sourced by the download_* scripts: their options, the question before a download, the download
# itself (resumable, checked), and data sets of sequences. Needs bash and curl.

name_of_script=$(basename "$0")
fail() {
  echo "$name_of_script: $*" >&2
  exit 1
}

# Reads the options that all have into list, to, yes and names. `list` and `to` have their defaults
# when this is called; the help is the comment at the top of the script.
parse_options() {
  yes=false names=()
  while (($#)); do
    case $1 in
      -h | --help)
        sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//;p}' "$0"
        exit
        ;;
      --to | --list)
        (($# >= 2)) || fail "$1: needs a value (see --help)"
        if [[ $1 == --to ]]; then to=$2; else list=$2; fi
        shift
        ;;
      --yes) yes=true ;;
      -*) fail "unknown option $1 (see --help)" ;;
      *) names+=("$1") ;;
    esac
    shift
  done
  [[ -f $list ]] || fail "no list at $list"
  command -v curl >/dev/null || fail "needs curl (apt-get install curl)"
}

# The rows of the list, without comments.
rows() {
  grep -vE '^(#|$)' "$list"
}

# Asks, unless --yes was given.
confirm() {
  local answer
  if $yes; then return; fi
  [[ -t 0 || ${STILLPOINT_ASK:-} ]] || fail "nobody to ask; give --yes to download without asking"
  read -rp "  Download? [y/N] " answer || answer=
  [[ $answer == [yY]* ]] || fail "not downloaded"
}

size_of() { # FILE: its bytes, 0 if there is none
  stat -c %s "$1" 2>/dev/null || echo 0
}

# What the server says that a file has, in bytes; nothing if it does not say.
size_at() { # URL
  curl --fail --location --silent --head --connect-timeout 20 "$1" |
    tr -d '\r' | awk 'tolower($1) == "content-length:" {n = $2} END {print n}' || true
}

# Downloads into PART, going on where an earlier try broke off: five tries, each from there.
fetch() { # URL PART MAX_BYTES
  local url=$1 part=$2 most=$3 try code shown=(--silent --show-error)
  [[ ! -t 2 ]] || shown=(--progress-bar)
  for try in 0 1 2 3 4; do
    code=0
    curl --fail --location "${shown[@]}" --connect-timeout 20 --speed-limit 1 \
      --speed-time 60 --max-filesize "$most" --continue-at - --output "$part" "$url" || code=$?
    case $code in
      0) return ;;
      33) rm -f "$part" ;; # the server cannot go on in the middle
      5 | 6 | 7 | 16 | 18 | 28 | 35 | 52 | 55 | 56 | 92) sleep $((try / 2)) ;;
      *) fail "$url: cannot be downloaded" ;;
    esac
  done
  fail "$url: broke off five times; try again, it goes on from $(size_of "$part") bytes"
}

# Fetches an archive to PART and checks its size; an archive that is too long is thrown away.
fetch_archive() { # URL PART BYTES
  local url=$1 part=$2 bytes=$3
  (($(size_of "$part") <= bytes)) || rm -f "$part"
  (($(size_of "$part") == bytes)) || fetch "$url" "$part" "$bytes"
  local found
  found=$(size_of "$part")
  if ((found != bytes)); then
    ((found < bytes)) || rm -f "$part"
    fail "$url: expected $bytes bytes, found $found; it changed, or the answer was cut off"
  fi
}

unpack() { # ARCHIVE FOLDER (both formats carry checksums, which the tools check)
  case $1 in
    *.zip.part)
      if command -v unzip >/dev/null; then
        unzip -q "$1" -d "$2"
      elif command -v python3 >/dev/null; then
        python3 -m zipfile -e "$1" "$2"
      else
        fail "needs unzip (apt-get install unzip)"
      fi
      ;;
    *) tar -xzf "$1" -C "$2" --no-same-owner ;;
  esac
}

# Downloads and unpacks one sequence. Nothing stands at $to/FOLDER before all of it is there.
get_sequence() { # FOLDER BYTES LICENSE URL
  local folder=$1 bytes=$2 license=$3 url=$4
  if [[ -f $to/$folder/rgb.txt ]]; then
    echo "$to/$folder is there already"
    return
  fi
  [[ ! -e $to/$folder ]] || fail "$to/$folder is there, but holds no rgb.txt; move it away"
  local said
  said=$(size_at "$url")
  [[ $said ]] || fail "$url: cannot be downloaded (the server does not say how large it is)"
  [[ $bytes == - || $bytes == "$said" ]] ||
    fail "$url: expected $bytes bytes, the server says $said; it changed"
  bytes=$said
  local part=$to/${url##*/}.part
  echo "$folder: $(((bytes + 999999) / 1000000)) MB, license: $license"
  echo "  from $url"
  (($(size_of "$part") == 0)) || echo "  $(($(size_of "$part") / 1000000)) MB are there from before"
  confirm
  mkdir -p "$to"
  local free
  free=$(df -Pk "$to" | awk 'NR == 2 {print $4}')
  ((free * 1024 > 2 * bytes + bytes / 10)) ||
    fail "$to: needs $((22 * bytes / 10000000)) MB, has $((free / 1024)) MB; give another --to"
  fetch_archive "$url" "$part" "$bytes"
  local unpacked=$to/.$folder.unpacking
  rm -rf "$unpacked"
  mkdir "$unpacked"
  # Broken beyond repair: it has its full size, so there is nothing to go on with.
  if ! unpack "$part" "$unpacked"; then
    rm -rf "$unpacked" "$part"
    fail "$url: the archive is damaged; try again, it is downloaded anew"
  fi
  local file
  for file in rgb.txt depth.txt groundtruth.txt rgb depth; do
    if [[ ! -e $unpacked/$folder/$file ]]; then
      rm -rf "$unpacked" "$part"
      fail "$url: expected $folder/$file in the archive, found none"
    fi
  done
  mv "$unpacked/$folder" "$to/$folder"
  rm -rf "$unpacked" "$part"
  echo "$to/$folder: downloaded and checked"
}

# The whole of download_tum, _bonn and _wild_slam: SET is the first column of the list.
download_sequences() { # SET
  local set=$1 wanted row folder bytes license url
  rows_of_set() { rows | awk -F'\t' -v set="$set" '$1 == set' | cut -f2-; }
  if ((${#names[@]} == 0)); then
    echo "Sequences (scripts/$name_of_script NAME..., or all):"
    while IFS=$'\t' read -r name folder bytes license url; do
      printf '  %-22s %-40s %s\n' "$name" "$folder" "$license"
    done < <(rows_of_set)
    return
  fi
  [[ ${names[*]} != all ]] || mapfile -t names < <(rows_of_set | cut -f1)
  for wanted in "${names[@]}"; do
    row=$(rows_of_set | awk -F'\t' -v name="$wanted" '$1 == name')
    [[ $row ]] ||
      fail "there is no sequence \"$wanted\"; there are: $(rows_of_set | cut -f1 | paste -sd' ') all"
  done
  for wanted in "${names[@]}"; do
    row=$(rows_of_set | awk -F'\t' -v name="$wanted" '$1 == name')
    IFS=$'\t' read -r _ folder bytes license url <<<"$row"
    get_sequence "$folder" "$bytes" "$license" "$url"
  done
  local next="stillpoint bench --paper $to"
  [[ $set != wild_slam ]] || next="stillpoint bench $to/*"
  echo "Next: masks of your network (stillpoint mask --help), then $next"
}
