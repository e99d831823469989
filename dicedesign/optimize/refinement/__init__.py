"""Dice designed anew from their throws, which tell what a momentum model gets wrong of them."""
