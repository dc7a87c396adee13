"""What the recordings of a campaign hold, before any law is fitted to them.

Each log is cut into stretches by its protocol: steady runs, breakaways and the motion after them, frequency
responses; torque that varies with position is found and taken off. Whatever is left out keeps its reason.
`gathering` is the door: `gather(recordings)` gives the evidence that a fit starts from.
"""
