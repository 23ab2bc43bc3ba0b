"""Campaigns spoilt as recordings of other laboratories are: is the answer right, or refused with the cause?"""
