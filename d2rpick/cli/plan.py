"""The command ``plan``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import deck_cost, plan_deck, typed
from d2rpick.cli import options as shared
from d2rpick.cli.card_options import all_cautions, card_options, card_request, energy_of, need_ids, prints_card
from d2rpick.cli.explorer import explorer_of
from d2rpick.cli.output import Output, finish, text_bytes
from d2rpick.cli.progress import reading
from d2rpick.cli.wording import in_words, with_options
from d2rpick.report.formats import FORMATS, Shown, write

if TYPE_CHECKING:
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.plan import Plan
    from d2rpick.choice.switched_run import Times
    from d2rpick.choice.verify import Verdict
    from d2rpick.deck.printed_card import PrintedCard

EXAMPLES = """\b
Examples:
  d2rpick plan --part box sample_data/rollover_box.matsum
  d2rpick plan --part box -f value sample_data/rollover_box.matsum
  d2rpick plan --part box -f card sample_data/rollover_box.matsum
  d2rpick plan --part box --plot plan.png --report plan.html sample_data/rollover_box.matsum
"""


@click.command("plan", epilog=EXAMPLES)
@click.option(
    "--min-rigid",
    type=shared.NOT_NEGATIVE,
    metavar="T",
    help="Leave shorter windows out.  [default: 5% of the record; one gives way to a later one twice as long]",
)
@click.option(
    "--all",
    "every",
    is_flag=True,
    help="With -f value, -f card and --write-deck: all windows, not only the supported ones.",
)
@click.option(
    "--done", metavar="FILE", type=shared.FILE,
    help="Windows in which HISTORY was switched, a line 'tr td' for each: plan those after.  -f value, -f card and "
    "--write-deck hold both, as the next run needs them.",
)  # fmt: skip
@click.option(
    "--before", metavar="HISTORY", multiple=True, type=shared.FILE,
    help="The run that the windows of --done were planned from: its landings are compared; repeatable.",
)  # fmt: skip
@plan_deck.deck_options
@shared.history_options
@shared.choosing_options
@card_options
@shared.output_options(*FORMATS["plan"], "card")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    min_rigid: float | None,
    every: bool,
    done: str | None,
    before: tuple[str, ...],
    output_format: str,
    exit_zero: bool,
    **options: Any,
) -> None:
    """Plan the rigid windows of a run: each of its flights with tr, td, and whether HISTORY supports it.

    Windows are supported up to and with the first that locks in energy: it moves the landings after it.  Run with
    these, then plan the next from the switched run, with --done.
    """
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.plan import plan_of

    _check_usage(output_format, options, every=every, done=done, before=before)
    form = "card" if options["write_deck"] else output_format
    options = plan_deck.for_deck(options) if form == "card" else options
    prints = prints_card(options, form)
    asked, settings = shared.Reading.of({**options, "part": ()}), shared.settings(options)
    with reading(asked.names, quiet=asked.quiet):
        run = asked.open()
        output = Output.of(options, *run.sources, *(name for name in (done, *before) if name not in (None, "-")))
        model = deck_cost.model_of(options)
        plan_deck.check_model(run, model, options)
        run, options = deck_cost.with_deck(run, options, settings, model)
        reference = Reference(run, energy_of(run, options, prints=prints))
        settings, unknown = deck_cost.with_cost(settings, reference, model, options["merge"])
        earlier = reference.like(asked._replace(names=before).open(), asked.selection) if before else None
    windows = _windows(done) if done else ()
    plan = plan_of(reference, settings, min_rigid=min_rigid, done=windows, before=earlier)
    plan = replace(plan, cautions=(*plan.cautions, *unknown))
    output.notes(reference.history.notes, plan.cautions)
    _beside(plan, reference, options, output)
    checked, passed = _deck(plan, reference, options, every=every) if options["write_deck"] else ("", True)
    if checked and output_format != "table":
        click.echo(checked, err=True)
    if output_format == "card":
        passed = _card(plan, reference, options, output, every=every) and passed
        return finish(ctx, objection=not passed, exit_zero=exit_zero)
    text = in_words(write("plan", output_format, plan, Shown(ctx.meta["d2rpick.command"], every=every)), output_format)
    output.result(f"{text}\n\n{checked}" if checked and output_format == "table" else text)
    return finish(ctx, objection=not (plan.supported and passed), exit_zero=exit_zero)


def _check_usage(form: str, options: dict[str, Any], *, every: bool, done: str | None, before: tuple[str, ...]) -> None:
    """Raise UsageError where options make no sense together, before a file is opened."""
    if every and form not in ("value", "card") and not options["write_deck"]:
        raise click.UsageError("--all belongs to -f value, -f card and --write-deck; other forms hold every window")
    plan_deck.check_usage(options["deck"], options["write_deck"])
    if before and done is None:
        raise click.UsageError("--before compares the landings of a switched run; name its windows with --done")
    if (form == "card" or options["write_deck"]) and not (options["part"] or options["node"]):
        what = "-f card" if form == "card" else "--write-deck"
        raise click.UsageError(f"{what} needs --part, the parts that are switched (Radioss: --node, their main nodes)")


def _windows(file: str) -> tuple[Times, ...]:
    """Read the windows of a file, which must follow each other."""
    from d2rpick.deck.printed_card import check_windows, read_windows

    with click.open_file(file, encoding="utf-8", errors="replace") as stream:
        return check_windows(read_windows(stream.read(), file))


def _beside(plan: Plan, reference: Reference, options: dict[str, Any], output: Output) -> None:
    """Write the figure and the page, as far as they are asked for."""
    if options["plot"]:
        from d2rpick.report import figures
        from d2rpick.report.figures_choice import draw_plan

        output.write(options["plot"], figures.render(draw_plan(plan), options["plot"]))
    if options["report"]:
        from d2rpick.choice.explored import explored_flights
        from d2rpick.report.pages import plan_page

        found = _judged(plan, reference, options, every=False)
        card = found[0].text if found else None
        explorer = explorer_of(explored_flights(reference, plan))
        page = plan_page(plan, reference.run, typed.repeat(), card, explorer)
        output.write(options["report"], text_bytes(with_options(page)))


def _deck(plan: Plan, reference: Reference, options: dict[str, Any], *, every: bool) -> tuple[str, bool]:
    """Write the copy of the deck with the cards, and check it; nothing without a window."""
    if not plan.windows(every=every):
        return "", True
    found = _judged(plan, reference, options, every=every)
    if found is None:
        raise click.UsageError(need_ids(card_request(reference.run, options, plan.history), plan.history))
    return plan_deck.write_and_check(found[0], plan, reference.run, options)


def _card(plan: Plan, reference: Reference, options: dict[str, Any], output: Output, *, every: bool) -> bool:
    """Print the cards of the windows, judged as they are printed; False where there are none or one fails."""
    if not plan.windows(every=every):
        output.content(b"")
        return False
    found = _judged(plan, reference, options, every=every)
    if found is None:
        raise click.UsageError(need_ids(card_request(reference.run, options, plan.history), plan.history))
    card, verdicts = found
    output.notes(card.notes, dict.fromkeys(c for one in verdicts for c in all_cautions(one) if not one.verified))
    output.content(card.text.encode())
    return all(verdict.verified for verdict in verdicts)


def _judged(
    plan: Plan, reference: Reference, options: dict[str, Any], *, every: bool
) -> tuple[PrintedCard, tuple[Verdict, ...]] | None:
    """Write the cards of the next run and judge them; None without a new window, or nobody to switch."""
    from d2rpick.choice.judged_card import card_of_plan

    if not plan.windows(every=every):
        return None
    return card_of_plan(plan, reference.run, card_request(reference.run, options, plan.history), every=every)
