"""Write the table of README.md from the headers of the scripts beside it."""

from pathlib import Path

here = Path(__file__).parent
rows = ["| finding | package | one would guess | what happens | why it matters |", "|---|---|---|---|---|"]
for script in sorted(here.glob("*.sh")):
    header = [line.partition(": ") for line in script.read_text().splitlines()[1:5]]
    rows.append(f"| [{script.stem}]({script.name}) | " + " | ".join(text for _, _, text in header) + " |")
text = (here / "README.md").read_text().partition("| finding |")[0]
(here / "README.md").write_text(text + "\n".join(rows) + "\n")
