"""Consistency of a campaign: runs and groups of runs that deviate from the fitted model, with the cause.

``causes`` lists possible causes. ``effects`` estimates the size of each cause from the residuals of a fit.
``runs`` finds single runs and ``groups`` finds groups of runs that deviate. ``joint`` fits a model for the
test without a card. ``errors`` compares the errors of one result.
"""
