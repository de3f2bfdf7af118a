"""Write the table of performance in README.md from docs/performance.md, which the benchmark writes.

python -m docs.readme_table        # in the root of the repository, after the benchmark
"""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
PERFORMANCE = ROOT / "docs" / "performance.md"
BEGIN, END = "<!-- from docs/performance.md: python -m docs.readme_table -->\n", "<!-- end of the table -->"
COLUMNS = ("solver", "solved", "position", "branches", "median", "p99")


def table() -> str:
    """The first table of the comparison, some of its columns.

    Raises:
        ValueError: the page has no such table, or a column is missing.
    """
    section = PERFORMANCE.read_text(encoding="utf-8").partition("## Beside its peers")[2]
    lines = section[section.index("\n|") + 1 :].partition("\n\n")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    chosen = [rows[0].index(name) for name in COLUMNS]
    rows[1] = ["---"] * len(rows[0])
    return "\n".join("| " + " | ".join(row[index] for index in chosen) + " |" for row in rows)


def with_table(text: str) -> str:
    """README with the table as the page has it now."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{table()}\n\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    README.write_text(with_table(README.read_text(encoding="utf-8")), encoding="utf-8")
