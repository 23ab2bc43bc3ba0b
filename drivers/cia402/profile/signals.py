"""Digital signals of a drive: safe torque off, seen as an input (60FD), and a holding brake, as an output (60FE). Pure.

Which bit is which is the drive's wiring, and so the rig file's word. Without that nothing is read or written.
"""

INPUTS, OUTPUTS = 0x60FD, 0x60FE
"""digital inputs; digital outputs with their levels in sub 1 and, in sub 2, the mask of those that are commanded"""
STO_SAYS = "its safe torque off (STO) is active: the motor cannot have power"
STO_HINT = "Is the emergency stop pulled out again, and the safety chain closed?"
