"""One body and one geometry from several campaigns, of robots with four, three, two … of the same cables.

in_common     which anchors, attachments and markers campaigns share
fit_jointly   recordings of some campaigns in, the body with its uncertainty out
cross         fitted on some, predicted on the others
identify      campaigns in, a JointResult out: what `fidim identify A B C` calls
"""
