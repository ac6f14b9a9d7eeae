"""Find when the parts fly, i.e. the window around td between the end of the load and the next contact.

Free flight means that gravity alone acts on the parts, and damping proportional to mass.  This folder decides in this
order:

1. `momentum` finds which parts fly together.  Their momentum p obeys p' = g - alpha p, with constant g and alpha
   >= 0 (`free_fall`); g must be gravity: that of the deck, else that of the earth in consistent units, in a window
   as long as the law holds (`window`).
2. `contact_forces` finds windows in which no contact and no rigid wall acts on them.
3. `work` finds windows in which the contact energy is constant (p and forces are unknown), or in which external
   work, kinetic and internal energy change as gravity and damping change them: as parabolas of time.
4. `internal_energy` finds the window in which the internal energy alone keeps its level, the poorest evidence.
   The energy must keep its level even if better evidence shows a flight, since bodies that collide keep their momentum.
5. `flight` asks these sources of evidence, best first.  The best source that shows a flight at td decides; a better
   one that shows none there is never overruled.  If two sources differ, the later start and the earlier end are used.
      Supported parts do not fly.
6. `chosen` joins this evidence with an oscillator that describes the energy, and with what the user gives
   (``--after``, ``--landing``), which overrules evidence with a doubt.

A flight is certain if its source is the momentum, or if one oscillator describes the energy in it: a fixed rigid wall
does no work, so that a crash into it looks like a flight in the energies.

Around a flight, `margin` says how long before the next contact td must lie: dt = sqrt(T / Kn) / omega + e / v, the
place error e over the closing speed v added to the amplitude of the vibration over that speed.  `position_error`,
`rotation` and `turning` say how far the rigid body will be out of place at td, since parts of it were frozen elsewhere
at tr; `vibrating` which parts vibrate together, and with what kinetic energy; `contact_times` when a force other than
gravity acts.
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
