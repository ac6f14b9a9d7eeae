"""Find when the parts fly, i.e. the window around td between the end of the load and the next contact.

Free flight means that only gravity and mass-proportional damping act on the parts. This folder decides in this order:

1. `momentum` finds which parts fly together. Their momentum p obeys p' = g - alpha p, with constant g and alpha >= 0
   (`free_fall`), in the longest window in which this law holds (`window`); g must be gravity, i.e. that of the deck or,
   without a deck, that of the earth in any consistent units.
2. `contact_forces` finds windows in which no contact and no rigid wall acts on the parts.
3. `work` finds windows in which the contact energy is constant, for runs without momenta and forces. It also finds
   windows in which external work, kinetic energy and internal energy change only as gravity and damping change them,
   i.e. as parabolas of time.
4. `internal_energy` finds the window in which the internal energy alone keeps its level, the poorest evidence.
   The energy must keep its level even if better evidence shows a flight, since bodies that collide keep their momentum.
5. `flight` uses these sources of evidence, most reliable first. The most reliable source that shows a flight at td
   decides, unless a more reliable one shows that td is not in a flight. If two sources differ, the later start and the
   earlier end are used. Supported parts do not fly.
6. `chosen` combines this evidence with an oscillator that describes the energy, and with the times that the user gives
   (``--after``, ``--landing``). The user's times overrule the evidence, but a contradiction is stated as a doubt.

A flight is certain if its source is the momentum, or if an oscillator describes the energy in it. Energies alone do not
suffice, because a fixed rigid wall does no work, so a crash into it looks like a flight.

Given a flight, `margin` computes how long before the next contact td must lie: dt = sqrt(T / Kn) / omega + e / v, i.e.
the amplitude of the vibration and the position error e, both divided by the closing speed v. `position_error`,
`rotation` and `turning` compute by how much the rigid body is misplaced at td, because some of its parts were frozen in
a different position at tr. `vibrating` finds which parts vibrate together, and their kinetic energy; `contact_times`
finds when a force other than gravity acts.
"""

from typing import Final

# Names of the data that can show a flight, from most to least reliable.
SOURCES: Final = (
    "given",
    "momentum",
    "contact-force",
    "contact-energy",
    "energy-balance",
    "oscillator",
    "energy",
)
