"""What is cut out of a campaign before effects are sought, and what is put back once they are known.

In: a campaign, then its fits. Out: a Cleaned campaign: hands, pushes and faults of sensors with their times.
"""
