"""Contact network and force chains of a run, from the collisions in a time window.

    python post/contacts.py runs/hopper.h5 --from 3.5 --until 4 -o contacts.png --csv contacts.csv

The force of a contact is the sum of its impulses divided by the length of the window.  A contact is
strong if its impulse exceeds --above times the mean.  Disks connected by strong contacts form a
force chain.

panels
  network    contacts as lines of a width proportional to the force; red: chains of --at-least disks
  forces     distribution of the forces between disks, in units of the mean force

table
  start, end             window of time, by default the last tenth of the run
  pairs, mean_force      number and mean force of the contacts between disks
  collisions_per_pair    mean number of collisions of a contact
  strong                 number of strong contacts
  chains, largest_chain  number of chains, number of disks in the largest chain

--contacts FILE writes a row for each contact: disks i and j (j <= 0: side or obstacle), number of
collisions, impulse, force, and change of momentum of disk i.

refuses
  runs without an event log (output.event_log = .true.), windows outside the run

see also
  docs/guides/contact-networks.md
"""

from ricochet.script import launch, run_analysis


def main() -> None:
    run_analysis("contacts", __doc__)


if __name__ == "__main__":
    launch(main)
