"""The pilot in the loop: a craft and K06's laws in real time, flown from a page in the browser.

Its page is what K06's pilot console [K06 fig B.1] was.

:class:`.loop.Loop` is the craft under a law, :class:`.pacer.Pacer` lets it run in real time, :mod:`.server`
serves the page (K06 appendix B has such a console).
"""
