"""CSV logs in the dialects that rigs write.

`text` gives a file's lines in one way, `records` joins those of a quoted cell, `cells` takes them apart and
says what is a number. `dialect` finds out how a file is written, with `headers` for what stands above the
numbers; what it finds is a `layout`. `rows` walks through the rows block by block and takes out what is
damaged, `cut_line` judges the last; `log` reads columns from them in one pass, and writes. `clocks` says
which column of times governs which signal, `description` what a file holds.
"""
