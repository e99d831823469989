"""STUB"""
from __future__ import annotations
from dataclasses import dataclass
import numpy as np, torch
from numpy.typing import NDArray
from dicedesign.throws.momentum import MomentumModel, hop
from dicedesign.design.differentiable import RestEvaluation
Floats = NDArray[np.float64]
@dataclass(frozen=True)
class ThrownOdds:
    model: MomentumModel
    def _tensor(self, rests, p, v):
        from dicedesign.design.centroid import hull_centroid
        from dicedesign.design.rest_formulas import facet_normals
        hull=rests.hull; paths=rests.paths
        c = hull_centroid(v,hull) if rests.given_center is None else rests.given_center
        r=v-c; R=torch.linalg.vector_norm(r,dim=1).max()
        n=facet_normals(hull,paths.rests,v)
        first=torch.as_tensor(hull.tail[hull.facet_start[paths.rests]])
        H=(n*r[first]).sum(-1)/R
        a,b=(r[torch.as_tensor(paths.saddle_ends[:,i])] for i in (0,1))
        e=b-a; s=a-e*((a*e).sum(-1)/(e*e).sum(-1))[:,None]
        U=torch.linalg.vector_norm(s,dim=1)/R
        bs=torch.as_tensor(paths.basins)
        I=torch.cat([bs[:,0],bs[:,1]]);J=torch.cat([bs[:,1],bs[:,0]])
        return hop(p,H,torch.cat([U,U]),I,J,self.model,torch)
    def odds(self, rests: RestEvaluation) -> Floats:
        with torch.no_grad():
            return self._tensor(rests, torch.as_tensor(rests.odds), rests.vertices.detach()).numpy()
    def jacobian(self, rests: RestEvaluation) -> Floats:
        v=rests.vertices.detach().clone().requires_grad_(); p=torch.as_tensor(rests.odds.copy()).requires_grad_()
        out=self._tensor(rests,p,v)
        rows=[]; pr=[]
        for x in out:
            a,b=torch.autograd.grad(x,(v,p),retain_graph=True); rows.append(a.numpy().ravel()); pr.append(b.numpy())
        return np.stack(rows)+np.stack(pr)@rests.jacobian
