# SPDX-License-Identifier: BSD-2-Clause
# Completion of pmsp-densify, pmsp-eval and pmsp-synth: verbs and options as the programs list them, else files.
_pmsp() {
  local program=$1 current=$2 verb="" help
  COMPREPLY=()
  if ((COMP_CWORD > 1)) && [[ ${COMP_WORDS[1]} =~ ^[a-z]+$ && ! -e ${COMP_WORDS[1]} ]]; then verb=${COMP_WORDS[1]}; fi
  if [[ $current == -* ]]; then
    help=$("$program" ${verb:+"$verb"} --help-all 2>/dev/null || "$program" ${verb:+"$verb"} --help 2>/dev/null)
    # Not those of examples and descriptions, but flags that descriptions name as the opposite of an option.
    help=$(grep -oE -e '^  (-[a-zA-Z], ?)?--[^ ]+' -e '--no-[a-z0-9-]+ disables' <<<"$help")
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE -- '--[a-z][a-z0-9-]+' <<<"$help" | sort -u)" -- "$current")
  elif ((COMP_CWORD == 1)); then
    help=$("$program" --help 2>/dev/null)
    mapfile -t COMPREPLY < <(compgen -W "$(sed -nE 's/^  ([a-z]+)  .*/\1/p' <<<"$help")" -- "$current")
  fi
}
complete -o default -F _pmsp pmsp-densify pmsp-eval pmsp-synth
