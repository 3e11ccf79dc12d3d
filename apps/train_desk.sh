#!/usr/bin/env bash
# Everything under worldmodel/weights/desk from nothing: recordings, shards, codec, judge, policy, world model, the page that
# says how true it is, and the judge's threshold by what that page saw (OUT/judge/balanced.safetensors). Every step goes on where it was killed, and one that is done says so at once.
#   apps/train_desk.sh EVAC OUT [LAST [CONFIGS]]
# EVAC: the program. LAST: the step to end after (default: balance). CONFIGS: a folder of other pages. The desk's own
# fidelity page is asked about four development states a cell; its forty reported ones would take as long as the training.
# Its policy is kept after some steps too; other pages may have fewer.
# OUT/time.csv gets a line for each start of a step: step, seconds, peak memory of its largest process in KiB, its exit
# code (128 and the signal's number where it was killed). A step that was killed together with this script has none.
set -euo pipefail
evac=$1 out=$2 last=${3:-balance} configs=${4:-$(dirname "${BASH_SOURCE[0]}")/configs}
model=$configs/desk_model.yaml training=$configs/desk_training.yaml codec=$out/codec/codec.safetensors
states=() kept=()
if [ $# -lt 4 ]; then
  states=(--set initial_states.seed=8101 --set initial_states.count=4)
  kept=(--keep-steps 250,500,1000,2000)
fi
case $last in
  collect | pack | codec | encode | judge | policy | world | fidelity | balance) ;;
  *) echo "train_desk: the last step is '$last', wanted collect, pack, codec, encode, judge, policy, world, fidelity or balance" >&2; exit 2 ;;
esac

finish() {
  awk -F, '{seconds += $2; if ($3 > peak) peak = $3}
    END {printf "%d starts of steps took %.1f minutes in all, no process more than %.1f GiB of memory (time.csv)\n", NR, seconds / 60, peak / 1048576}' "$out/time.csv"
  exit 0
}
step() {  # NAME evac's words …
  local code=0
  /usr/bin/time -o "$out/time.step" -q -f "%e,%M" "$evac" "${@:2}" || code=$?  # its own %x is 0 after a signal
  echo "$1,$(cat "$out/time.step"),$code" >> "$out/time.csv"
  rm "$out/time.step"
  if [ "$code" != 0 ] && [ "$1,$code" != balance,3 ]; then exit "$code"; fi  # 3: too few pairs to choose a threshold by
  if [ "$1" = "$last" ]; then finish; fi
}
learn() { step "$1" train "$1" "$out/shards" --config "$model" --training "$training" --out "$out/$1" "${@:2}"; }

mkdir -p "$out"
step collect collect "$configs/desk_recipe.yaml" --seed 7 --out "$out/recordings"
step pack pack "$out/recordings" --config "$model" --out "$out/shards"
learn codec
step encode encode "$out/shards" --config "$model" --codec "$codec"
learn judge --codec "$codec"
learn policy --codec "$codec" "${kept[@]}"
learn world --codec "$codec"
step fidelity fidelity "$configs/fidelity.yaml" --set "worlds.2.weights=$out/world/weights.safetensors" \
  --set "worlds.2.statistics=$out/shards/statistics.yaml" \
  --classifier "$out/judge/judge.safetensors" --out "$out/fidelity" "${states[@]}"
step balance judge balance "$out/fidelity/closed" --weights "$out/judge/judge.safetensors" --out "$out/judge/balanced.safetensors"
