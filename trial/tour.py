"""tour.py GROUND : a nominal tour by simulated bodies, MFoW over the second half."""
import sys,numpy as np,math
from patrol.scenario import load_scenario
from patrol.prepare import prepare
from agent.build import Shared
from agent.ports import *
from agent.policies.common_plan.robots import PlannedRobot
from patrol.ground.fog import Fog
from patrol.radio.peers import Peer
src=open("trial/one.py").read()
G={}
exec(src[src.index('sh="maps/"'):src.index("terrain,point,robots=G")])
terrain,point,robots=G[sys.argv[1]]
sc=load_scenario({"terrain":terrain,"point":point,"robots":robots,"patrol":{"policy":"stochastic"},"seed":3003})
p=prepare(sc); sh=Shared(p); spec=sc.roster[0]; f=p.fields[1]
setup=PolicySetup(RobotSetup(spec,sc.lengths[1]),GroundSetup(p.terrain,f,sh.posts_of(f),sh.footprint,sh.known,{}),sh.fleet,sh.kind.options)
r=sh.known.rounds[1]; n=len(sc.roster); W=p.terrain.width; step=sc.step
T=r.length_m/sum(s.speed for s in sc.roster); Tt=T/step
counted=np.zeros(p.terrain.shape,bool); counted.flat[r.points]=True
fog=Fog(counted); fp=sh.footprint
places=np.array([p.terrain.centre(*divmod(int(c),W)) for c in r.places])
along=r.along[:len(r.places)]
firsts=np.searchsorted(r.place_of,np.arange(len(r.places)+1))
speeds=np.array([s.speed for s in sc.roster]); heads=np.concatenate([[0],np.cumsum(speeds)[:-1]])/speeds.sum()*r.length_m
from itertools import permutations
starts=[(q.x,q.y) for q in p.starts]
best=None
for off in np.linspace(0,r.length_m/n,12,endpoint=False):
    hp=np.array([places[np.searchsorted(along,(h+off)%r.length_m)%len(along)] for h in heads])
    D=np.sqrt(((np.array(starts)[:,None]-hp[None])**2).sum(2))
    if n<=7:
        for pm in permutations(range(n)):
            c=max(D[i,pm[i]] for i in range(n))
            if best is None or c<best[0]: best=(c,off,pm)
    else:
        pm=list(range(n)); best=(0,0,pm)
c,off,pm=best
cur=[int(np.searchsorted(along,(heads[pm[i]]+off)%r.length_m)%len(along)) for i in range(n)]
R=[PlannedRobot(setup,s,q,0) for s,q in zip(sc.roster,p.starts)]
ahead=max(fp.range_m,4*spec.speed*step)
begun=False; m=[]
for q in R: fog.observe(fp.visible(q.heard),0)
pts=r.points
def nxt(i,t):
    k=cur[i]; end=along[k]+ahead
    last=int(np.searchsorted(along,end)); st=[(k,last)]
    if end>r.length_m: st.append((0,min(int(np.searchsorted(along,end-r.length_m)),k)))
    thr=max(1.0,min(.5*Tt,.5*fog.mfow(t)))
    for a,b in st:
        sl=slice(int(firsts[a]),int(firsts[b]))
        ages=t-np.maximum(fog.last_seen.flat[pts[sl]],0)
        idx=np.flatnonzero(ages>=thr)
        if idx.size:
            j=idx[0]; return int(r.stands[sl][j]), int(r.place_of[sl][j]), True
    e=st[-1][1]%len(along)
    return int(r.places[e]), e, False
dur=int({"office":1500}.get(sys.argv[1],1200)/step)
stuck=[0]*n
SL=float(sys.argv[2])
for t in range(dur):
    peers={q.spec.number:Peer(t,q.heard,t) for q in R}
    allthere=True
    for i,q in enumerate(R):
        if not begun:
            q.stand=int(r.places[cur[i]])
            d=math.dist((q.heard.x,q.heard.y),places[cur[i]])
            if d>max(2*spec.speed*step,2*spec.turning_radius if spec.model=="car" else 0): allthere=False
        else:
            q.stand,pl,stale=nxt(i,t)
            if stale: cur[i]=pl
            else:
                # come on with the robot
                d=((places-(q.heard.x,q.heard.y))**2).sum(1)
                rel=(along-along[cur[i]])%r.length_m
                ok=rel<ahead; d=np.where(ok,d,np.inf); cur[i]=int(d.argmin())
    if not begun and allthere: begun=True; print("begun at",t*step)
    waits=set()
    if begun and n>1:
        pos=[float(along[cur[i]]) for i in range(n)]
        order=sorted(range(n),key=lambda i:pos[i])
        gap={i:(pos[order[(k+1)%n]]-pos[i])%r.length_m for k,i in enumerate(order)}
        back={order[(k+1)%n]:gap[i] for k,i in enumerate(order)}
        for i in range(n):
            if gap[i]+SL*r.length_m/n<back[i]: waits.add(i)
    from patrol.pose import halted
    for i,q in enumerate(R):
        if i in waits:
            q.command=halted(q.spec.model); continue
        q.choose(t,{k:v for k,v in peers.items() if k!=q.spec.number})
    for q in R: q.move()
    for q in R: fog.observe(fp.visible(q.heard),t+1)
    m.append(fog.mfow(t+1)*step)
print(sys.argv[1],"T",round(T,1),"late mean",np.mean(m[len(m)//2:]).round(1),"max late",max(m[len(m)//2:]),"mean",np.mean(m).round(1))
