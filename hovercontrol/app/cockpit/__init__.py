"""The pilot in the loop: a craft with K06's laws in real time, controlled from a page in the browser.

Its page corresponds to K06's pilot console [K06 fig B.1], its real loop to figure 5.2.

:class:`.loop.Loop` is the ideal craft under a law, :class:`.real_loop.RealLoop` the same through ground
station, link, navigation and actuators (:func:`.real_block.ground_station`, one hybrid Block); both take
orders by :mod:`.orders`. :class:`.pacer.Pacer` lets a loop run in real time, :mod:`.server` serves the page.
"""
