#!/bin/sh
# package: Typer 0.29.2 with shellingham 1.5.4
# guess: `app --show-completion zsh` prints the completion script for zsh.
# happens: The option is a flag of "the current shell" and the word zsh is ignored. The script is that of the shell among the parents of the process: bash's under bash, none under a plain `sh`.
# why: A Makefile, a Dockerfile or a package build that writes completion files gets the wrong script, or an empty file.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check typer==0.29.2 shellingham==1.5.4
cat > "$folder/app.py" <<'END'
import typer

app = typer.Typer()


@app.command()
def greet(name: str) -> None:
    print(name)


app()
END
cd "$folder"
bash -c 'venv/bin/python app.py --show-completion zsh; true' > from_bash 2>&1
sh -c 'venv/bin/python app.py --show-completion zsh; true' > from_sh 2>&1
venv/bin/pip list --disable-pip-version-check --format=freeze | grep -E '^(typer|shellingham)='
echo "--show-completion zsh, run by bash:"; sed 's/^/  /' from_bash
echo "--show-completion zsh, run by sh:"; sed 's/^/  /' from_sh
grep -q COMPREPLY from_bash && ! grep -q '#compdef' from_bash && ! grep -q '#compdef' from_sh || exit 1
