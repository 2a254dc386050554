"""Shadow ensembles: perturbed motions carried beside motions, whose spread tells how errors grow."""
