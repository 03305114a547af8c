using System;
using Nep;

// Listing 10 of the paper: wait for messages and print them.
namespace Example
{
    class Program
    {
        static void Main(string[] args)
        {
            Nep.Node node = new Nep.Node("csharp_receiver");
            Nep.Subscriber sub = node.new_sub("test");
            while (true)
            {
                string msg = sub.listen();
                Console.WriteLine(msg);
            }
        }
    }
}
