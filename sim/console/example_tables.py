"""What people read of the worked example: what is printed against what is solved, by every method."""

from pivoting.controller.solution import Solution
from pivoting.controller.worked_example import EXAMPLES, Digit
from rich.console import Console
from rich.table import Table


def print_examples(console: Console, results: list[tuple[list[Digit], Solution]]) -> None:
    """The worked example: what is printed against what is solved, then how far each method is from it."""
    for example in EXAMPLES:
        mine = [(digits, solution) for digits, solution in results if digits[0].example == example.name]
        console.print(f"[bold]{example.name}[/]: {example.summary}", soft_wrap=True)
        table = Table()
        for heading in ("", "expected", "solved", "last digit"):
            table.add_column(heading, justify="left" if not heading else "right")
        for digit in mine[0][0]:
            places = len(digit.expected.partition(".")[2]) + 2
            word = "same" if digit.rounds else "1 apart" if digit.agrees else "[red]DIFFERS[/]"
            table.add_row(digit.quantity, digit.expected, f"{digit.value:.{places}f}", word)
        console.print(table)
    methods = Table()
    for heading in ("method", *(f"KKT residual, {example.name}" for example in EXAMPLES), "digits"):
        methods.add_column(heading, justify="left" if heading == "method" else "right")
    for name in dict.fromkeys(digits[0].method for digits, _ in results):
        own = [(digits, solution) for digits, solution in results if digits[0].method == name]
        cells = [
            f"{solution.residual:.0e}" + ("" if solution.status == "solved" else f" ({solution.status})")
            for _, solution in own
        ]
        agree = all(digit.agrees for digits, _ in own for digit in digits)
        methods.add_row(name, *cells, "[green]agree[/]" if agree else "[red]DIFFER[/]")
    console.print(methods)
    exact = [digit for digit in results[0][0] if digit.agrees and not digit.rounds]
    for digit in exact:
        console.print(
            f"{digit.quantity}: the notes print {digit.expected}; the optimum is {digit.value:.7f}, one unit of the"
            " last digit away, which is what their solver's tolerance leaves (docs/errata.md).",
            soft_wrap=True,
            highlight=False,
        )
