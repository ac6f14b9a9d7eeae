"""Refused input gives one line with what was found, what was expected and what to do, and no file is written."""

import shlex
from pathlib import Path

import pytest

from tests.command import (
    BOX,
    DECK,
    ENERGY,
    GLSTAT,
    MATSUM,
    OSCILLATOR,
    ROLLOVER,
    read_refusal,
)
from tests.computed import locate_stored
from tests.sample_deck import DECK as SAMPLE

CAR = locate_stored("carT01.gz")
GIVEN = shlex.join(OSCILLATOR)
ONE_COMMAND = f"replay {GIVEN} --t-end 0.01 --dt 1e-3"
# Command lines, and parts of their message; $ marks the end of the message.
REFUSALS = f"""
sugest --td 1 x | No such command 'sugest' | Did you mean 'suggest'? | d2rpick --help
dance | No such command 'dance' | plan, suggest
# click words this in its own way in each version; the near names stand in all
suggest --tdd 1 x | --tdd | Did you mean '--td'? | d2rpick suggest --help
suggest --min-rigid 1 x | --min-rigid | It is an option of d2rpick plan | d2rpick suggest --help
suggest --td 1 --part 2-1 {MATSUM} | {MATSUM} | the range 2-1 runs backwards; write 1-2$
verify --tolerence 1 x | --tolerence | --tolerance
suggest --td 1 --td-window 1 2 x | --td | --td-window
verify --td 1 x | --tr
suggest --td 1 | HISTORY
suggest --td 1 x y | x: no such file
suggest --td 1 --part 1 --energy 2 x | --energy and --part exclude each other
suggest --td 0,064 x | --td | '0,064' is not a number
suggest --td nan x | --td | 'nan' was found, but a time
suggest --td inf x | --td | 'inf' was found, but a time
suggest --td 1 -f jsno x | 'jsno' | 'json'
verify --tr 1 --td 2 -f value x | 'value' | 'markdown'
suggest --td 1 -F d3hsp x | 'd3hsp' | 'hdf5' | 'glstat'
suggest --td 1 --limit 0 x | --limit | 1
suggest --td 1 --margin -1 x | --margin | -1 was found | at least 0 was expected
suggest --td 1 --tolerance -1 x | --tolerance | at least 0 was expected
suggest --td 1 --stiffness 0 x | --stiffness | above 0 was expected
suggest --td 1 --step-ratio 0.5 --cost-share 0.5 x | --step-ratio | at least 1 was expected
parts --deck x --step-ratio 0.5 x | --step-ratio | at least 1 was expected
# contradictions
verify --tr 0.07 --td 0.064 {ENERGY} | tr 0.07 is not before td 0.064
verify --tr 0.064 --td 0.064 {ENERGY} | tr and td are both 0.064; give a td after tr
suggest --td -1 {ENERGY} | {ENERGY} | --td -1 lies outside the record, 0 to 0.15
verify --tr -1 --td 0.064 {ENERGY} | {ENERGY} | --tr -1 lies outside the record, 0 to 0.15
suggest --td 0.064 {GIVEN} --no-verify {ENERGY} | an oscillator | --no-verify | exclude
suggest --td 0.064 {GIVEN} --fit-window 0 0.1 {ENERGY} | an oscillator | --fit-window | exclude
suggest --td 0.064 --no-verify --fit-window 0 0.1 {ENERGY} | --no-verify | --fit-window | exclude
suggest --td 0.064 --fit-window 0.1 0.05 {ENERGY} | --fit-window 0.1 0.05 is empty
suggest --td 0.064 --mass 31.4 {ENERGY} | --mass needs --stiffness
suggest --td 0.064 {GIVEN} --frame-mass 2 {ENERGY} | either --frame-mass or --beta
suggest --td 0.064 {GIVEN} --alpha 5000 {ENERGY} | alpha 5000 | less than 502.2
suggest --td 0.064 {GIVEN} --mass 1e-308 {ENERGY} | mass is 1e-308 | from 1e-100 to 1e+100
verify --tr 0.01 --td 0.064 {GIVEN} --beta 1e308 {ENERGY} | frame_mass is 3.1 | from 1e-100 to 1e+100
explore --td-window 0.06 0.07 {GIVEN} --v0 -1e308 {ENERGY} | v0 is -1e+308 | energies above 1e+150
suggest --td 0.064 {GIVEN} --v0 1e155 {ENERGY} | v0 is 1e+155 | energies above 1e+150
# no name of a file; no shell can pass it
suggest --td 1 'a\0b' | 'a\\x00b' holds a NUL byte
suggest --td 0.064 -o 'a\0b' {ENERGY} | --output-file | NUL byte
plan --deck 'a\0b' {ENERGY} | --deck | NUL byte
check 'a\0b' | NUL byte
# replay
replay | --stiffness
replay --stiffness 1 --mass 1 --v0 1 --t-end 1 --dt 1 | --frame-mass NUMBER or --beta
replay --stiffness 1 --mass 1 --beta 1 --t-end 1 --dt 1 | start of the motion | --v0 | --vy0
{ONE_COMMAND} --vz0 1 | --v0 and --vz0 exclude each other
{ONE_COMMAND} --dt 0 | --dt | above 0 was expected
{ONE_COMMAND} --dt 1e-12 | --dt 1e-12 | 10000000
{ONE_COMMAND} --tr 0.006 | give --tr and --td together
{ONE_COMMAND} --td 0.006 | give --tr and --td together
{ONE_COMMAND} --tr 0.006 --td 0.005 | --tr 0.006 is not before --td 0.005
{ONE_COMMAND} -o motion.txt | motion.txt | --write-as: csv, hdf5, glstat, matsum
replay --stiffness 1 --mass 1 --beta 1 --v0 1 --t-end 1e-308 --dt 1e-308 | exceeds the range of numbers
# files to be written; all of them are known to be wrong before anything is computed
suggest --td 0.064 -o absent/result.txt {ENERGY} | absent/result.txt: no such folder: 'absent'
suggest --td 0.064 -o . {ENERGY} | .: this is a folder
suggest --td 0.064 -o '' {ENERGY} | this is a folder
suggest --td 0.064 --plot absent/plot.png {ENERGY} | absent/plot.png: no such folder: 'absent'
suggest --td 0.064 --plot plot.gif {ENERGY} | plot.gif | png, svg, pdf
suggest --td 0.064 --plot plot {ENERGY} | plot:  | png, svg, pdf
suggest --td 0.064 -o x.svg --plot ./x.svg {ENERGY} | --plot and --output-file are the same file
{ONE_COMMAND} --plot plot.gif | plot.gif | png, svg, pdf
# what a command cannot do
explore --td-window 0.07 0.06 {ENERGY} | the lower time first
explore --td-window 1 2 {ENERGY} | outside the record
explore --td 9 {ENERGY} | outside the record
explore --steps 0 {ENERGY} | --steps
plan --all {ENERGY} | --all belongs to -f value, -f card and --write-deck
plan --before {BOX} {BOX} | name its windows with --done
plan -f card {ENERGY} | needs --part
plan --node 3 {ENERGY} | is an option of the card
plan --done nowhere.txt {BOX} | nowhere.txt: no such file; check the name and the folder
plan --min-rigid -1 {BOX} | at least 0
parts --tr 0.1 {MATSUM} | --tr needs --td
parts --tr 0.3 --td 0.1 {MATSUM} | tr must lie before td
parts --weights site.toml {MATSUM} | --weights needs --deck
parts --deck absent.k {MATSUM} | absent.k
parts --deck {MATSUM} {MATSUM} | this is a matsum of LS-DYNA, but a deck was expected
parts --energy 1 {MATSUM} | --energy names one energy
parts --part 77 --deck {SAMPLE} {MATSUM} | no part 77
parts --part recommended --deck {SAMPLE} {MATSUM} | name a set to compare
parts --weights {SAMPLE} --deck {SAMPLE} {MATSUM} | TOML file of weights was expected
card --part 1 --tr 0.09 --td 0.02 | tr < td was expected
card --tr 0.01 --td 0.02 | missing: --part
card --part 1 --td 0.02 | missing: --tr T
card --part 1 --tr 0.02 --td 0.09 --tr 0.2 | 2 --tr and 1 --td
card --part 1 --tr 0.02 --td 0.09 --windows w.txt | --windows excludes
card --part 1 --windows absent.txt | absent.txt
card --part 1 --tr 0.02 --td 0.09 --tr 0.05 --td 0.2 | overlaps
card --part 1 --tr 0.2 --td 0.3 --tr 0.05 --td 0.09 | lies before
card --part door --tr 0.01 --td 0.02 | titles need a --history
card --part 1-99999999 --tr 0.01 --td 0.02 | holds more than 100000 numbers
card --part 9-3 --tr 0.01 --td 0.02 | give the smaller number first, 3-9
card --part 0 --tr 0.01 --td 0.02 | does not fit
card --part 1 --node 3 --tr 0.01 --td 0.02 | --node is an option of --solver radioss
card --solver radioss --part 1 --tr 0.01 --td 0.02 | missing: --node
card --solver radioss --node 1 --tr 0.01 --td 0.02 | missing: --end
card --solver radioss --node 1 --end 0.015 --tr 0.01 --td 0.02 | the run ends at 0.015
card --solver radioss --node 1 --merge 1 --end 1 --tr 0.01 --td 0.02 | --merge is an option of --solver ls-dyna
card --solver radioss --part 7 --node 1 --end 1 --tr 0.01 --td 0.02 | give a --history with parts
card --solver radioss --part 7 --node 1 --tr 0.01 --td 0.02 --history {ENERGY} | give a --history with parts
card --solver radioss --node 1 --end 1 --name a/b --tr 0.01 --td 0.02 | the name of the run is 'a/b'
card --solver radioss --node 1 --end 1 --name '' --tr 0.01 --td 0.02 | the name of the run is ''
card --part 1 --swset 5 5 --tr 0.01 --td 0.02 | both switch sets have id 5
card --part 1 --margin 0 --tr 0.01 --td 0.02 | --margin needs an energy history
card --part 1 --tolerance 0.3 --tr 0.01 --td 0.02 | --tolerance needs an energy history
card --part 1 -F csv --tr 0.01 --td 0.02 | --input-format needs an energy history
card --part 1 --after 0.01 --tr 0.01 --td 0.02 | give one with --history
card --part 1 --tr 0.01 --td 7 --history {ENERGY} | lies outside the record
check {DECK} --select D2R10l | did you mean D2R1
check {DECK} --ignore D2R999 | no rule 'D2R999'
check {DECK} --after 0.03 | give one with --history
check {DECK} --energy boxIE_J | give one with --history
check {DECK} --history absent.csv | absent.csv
check {DECK} --history {ENERGY} --after 7 | --after 7 lies outside the record
check {DECK} --fail-on info | info
check {DECK} -f toml | toml
follow --once --wait 0.002 {CAR} | --wait 0.002 is below
follow --once {GLSTAT} | neither momenta nor the contact energy
follow --once --for 3 {CAR} | --once and --for exclude each other
follow --once --wait 0 {CAR} | --wait
follow --once --part nobody {CAR} | nobody
follow --once --deck /nowhere.rad {CAR} | /nowhere.rad
suggest --td-window 0.07 0.06 {ENERGY} | --td-window 0.07 0.06 is empty
suggest --td 0.06 --step-ratio 2 {ENERGY} | --step-ratio needs --cost-share
suggest --td 0.06 --cost-share 2 {ENERGY} | at most 1
# inputs that are not there, or not so
suggest --td 0.064 absent.csv | absent.csv: no such file | check the name
suggest --td 0.064 {Path(__file__).parent} | {Path(__file__).parent}: no glstat, matsum, binout, d3plot | give the file
suggest --td 0.064 {GLSTAT} -F csv | {GLSTAT}:1:  | a table of time and energy
suggest --td 0.064 {GLSTAT} --energy 'internal enrgy' | did you mean 'internal energy' | kinetic energy
suggest --td 0.064 {GLSTAT} --time cycle | no time 'cycle' | leave --time out
suggest --td 0.064 {ROLLOVER} | {ROLLOVER}: 3 columns | --energy | 'boxIE_J'
# parts that are not there
suggest --td 0.37 --part bax {BOX} | no part 'bax' | did you mean | 1 'box', 2 'step', 3 'sled'
suggest --td 0.37 --part 7 {BOX} | no part 7 (expected part ids, not set ids) | 1 'box', 2 'step', 3 'sled'
suggest --td 0.37 --part box --flying 7 {BOX} | no part 7 | 1 'box'
suggest --td 0.37 --part box --energy 1 {BOX} | --energy and --part exclude each other
plan --part recommended {MATSUM} | --part recommended needs --deck
plan --part recommended --part 3 --deck {SAMPLE} {MATSUM} | is a whole set
suggest --after 0.2 --landing 0.1 {ENERGY} | --landing 0.1 is not after --after 0.2
suggest --landing 150 {ENERGY} | --landing 150 lies outside the record
# near misses, in times by a unit
suggest --td 64 {ENERGY} | was it meant in ms? Then give --td 0.064, in the unit of the record
suggest --td-window 60 70 {ENERGY} | was it meant in ms? Then give --td-window 0.06 0.07, in the unit of the record
suggest --td 0.064 --after 86 {ENERGY} | Then give --after 0.086, in the unit of the record
suggest --td 0.064 --fit-window 10 60 {ENERGY} | Then give --fit-window 0.01 0.06, in the unit of
suggest --td-window 0.06 0.2 {ENERGY} | --td-window 0.06 0.2 reaches outside the record, 0 to 0.15; give times within
suggest --td 0.16 {ENERGY} | --td 0.16 lies outside the record, 0 to 0.15; give a time within it$
suggest --td 0.6 {ENERGY} | --td 0.6 lies outside the record, 0 to 0.15; give a time within it$
suggest --td 2 {ENERGY} | --td 2 lies outside the record, 0 to 0.15; give a time within it$
suggest --td 64ms {ENERGY} | --td | unit of time is not known from {ENERGY} | give 0.064 if it is s, 64 if it is ms
suggest 64 {ENERGY} | a time is given as --td, a number in the unit of the record
suggest 64ms {ENERGY} | a time is given as --td, a number in the unit of the record, 0.064 if that unit is s
suggest --td 0.064 {ENERGY.replace("energy", "enrgy")} | (did you mean 'energy.csv'?)
# a box that cannot be computed
rollover --tr 0.1 | give one --td for each --tr
rollover --tr 0.2 --td 0.1 | is not before
rollover --tr 0.1 --td 0.2 --tr 0.2 --td 0.3 | --tr 0.2 is not after --td 0.2
rollover --tr 0.1 --td 0.2 --tr 0.3 | give one --td for each --tr
rollover --tilt 10 | --tilt needs --drop
rollover --scan --drop 1 | --scan and --drop exclude each other
rollover --scan --td 0.3 --td 0.4 | takes one --td
rollover --tr 0.2 --td 0.5 | after the end of the run
rollover --tr -1 --td 0.1 | at least 0
rollover --scan --td 0 --mesh 4 | no time for tr
rollover --stiffness 1e15 | choose softer bars
rollover --mesh 100000 | 200
rollover --scan --tr 0.1 | exclude each other
rollover --scan --write-as csv | exclude each other
rollover --scan --with-step | exclude each other
rollover --with-step | needs --tr and --td
rollover --jobs 2 | needs --scan
rollover -f json | needs --scan
rollover --dt 1e-9 | more than
rollover --mesh 3 | 4
rollover --scan --td 0.5 --mesh 4 | end of the flight
rollover -o run.txt | --write-as
# what becomes infinite, or holds no number of steps
rollover --dt 1e308 --t-end 0.001 --mesh 4 | is longer than the run
rollover --stiffness 1e308 --t-end 0.001 --mesh 4 | holds no number of steps
rollover --drop 1e308 --t-end 0.001 --mesh 4 | infinite
rollover --speed 1e300 --t-end 0.001 --mesh 4 | infinite
"""


@pytest.mark.parametrize(
    "row", [row for row in REFUSALS.strip().split("\n") if not row.startswith("# ")]
)
def test_what_cannot_be_run_is_told_in_one_line(row: str, here: Path) -> None:
    line, *parts = row.split(" | ")
    message = f"{read_refusal(*shlex.split(line))}$"
    for part in parts:
        assert part in message
    assert not list(here.iterdir())
